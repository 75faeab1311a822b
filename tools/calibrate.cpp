// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/calibrate.hpp"

#include <cstdio>
#include <stdexcept>

#include <poll.h>
#include <unistd.h>

#include "config/calibration_store.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/device_homing.hpp"
#include "devices/links/reconnecting_link.hpp"
#include "tools/connected_device.hpp"
#include "tools/end_signals.hpp"

namespace wrenchd {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(1);

/// Returns true if the operator has typed a line since the last call.
bool line_typed() {
  pollfd input = {STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, 0) <= 0 || (input.revents & POLLIN) == 0) return false;
  char c = 0;
  while (read(STDIN_FILENO, &c, 1) == 1)
    if (c == '\n') return true;
  return false;
}

}  // namespace

Calibration calibrate(ProfileDevice& device, const DeviceProfile& profile, const std::string& serial,
                      Clock& clock, const OperatorInterface& operator_interface) {
  DeviceHoming homing(device, profile, DeviceHoming::Extent::full);
  std::string last_instruction;
  while (!operator_interface.cancelled()) {
    clock.sleep_until(clock.now() + kPeriod);
    if (homing.state().step == HomingStep::reference && operator_interface.confirmed()) homing.confirm();
    const HomingState& state = homing.step(clock.now());
    if (homing.device_lost())
      throw std::runtime_error("the device was disconnected; connect it and start again");
    const std::string instruction = operator_instruction(state);
    if (state.step == HomingStep::failed) throw std::runtime_error(instruction);
    if (instruction != last_instruction) operator_interface.instruct(instruction);
    last_instruction = instruction;
    if (state.step == HomingStep::done) return {profile.name, serial, homing.offsets()};
  }
  throw std::runtime_error("cancelled; no calibration was stored");
}

int run_calibrate(const CalibrateOptions& options) {
  const ConnectedDevice target = find_connected_device(options.profile, options.serial);
  if (target.device.serial.empty())
    throw std::runtime_error(
        describe(target.device) +
        ": the device has no serial number, so its calibration cannot be stored; change its "
        "firmware to send a serial number");
  const std::string& serial = target.device.serial;
  const CalibrationStore store;
  ReconnectingLink link(target.profile, serial, link_settings(target.profile));
  ProfileDevice device(target.profile, link);
  WallClock clock;
  device.open();
  catch_end_signals();
  std::printf("%s, serial number %s. The motors stay off. Ctrl-C cancels.\n", target.profile.name.c_str(),
              serial.c_str());
  const OperatorInterface operator_interface = {[](const std::string& instruction) {
                                                  std::printf("%s\n", instruction.c_str());
                                                  std::fflush(stdout);
                                                },
                                                line_typed, end_requested};
  const auto release_device = [&] {
    device.release(clock.now());
    device.close();
  };
  Calibration calibration;
  try {
    calibration = calibrate(device, target.profile, serial, clock, operator_interface);
  } catch (...) {
    release_device();
    throw;
  }
  release_device();
  store.write(calibration);
  std::printf("Stored in %s.\n", store.file_of(calibration.profile, calibration.serial).c_str());
  return 0;
}

}  // namespace wrenchd
