// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/device_port.hpp"

namespace wrenchd {

DeviceReading DevicePort::read(TimePoint now) noexcept {
  const std::uint64_t last_command_sent = device_.commands_sent();
  return {device_.read_newest(now), last_command_sent};
}

Written DevicePort::write(TimePoint now, const Wrench& F, const Authority& authority,
                          const std::optional<Pose>& X_BH_held) noexcept {
  device_.set_proxy_pose(X_BH_held);
  Written written;
  written.motors_on = last_.motors_on;
  if (!authority.send) return last_ = written;
  written.sent = true;
  written.F = F;
  written.motors_on = authority.motors_on;
  written.result = device_.write(now, F, authority.motors_on);
  written.faults = write_watch_.check(written.result, now);
  if (written.motors_on && (written.faults & bit(Fault::write_failed)) != 0) {
    written.F = Wrench{};
    written.motors_on = false;
    written.result = device_.write(now, Wrench{}, false);
  }
  return last_ = written;
}

Written DevicePort::release(TimePoint now) noexcept {
  device_.release(now);
  write_watch_.reset();
  return last_ = Written{};
}

}  // namespace wrenchd
