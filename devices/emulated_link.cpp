// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/emulated_link.hpp"

#include <algorithm>
#include <stdexcept>

namespace wrenchd {

void EmulatedLink::open() {
  close();
  if (!plugged_) throw std::runtime_error("emulated device: unplugged; plug it in again");
  device_.advance_to(clock_.now(), *this);
  reports_.clear();
  open_ = true;
}

LinkRead EmulatedLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  if (!open_) return {LinkStatus::gone, 0, now};
  device_.advance_to(now, *this);
  const Packet* packet = reports_.arrived(now);
  if (packet == nullptr) return {LinkStatus::empty, 0, now};
  const LinkRead read{LinkStatus::ok, packet->length, packet->arrives};
  const auto bytes = packet->report().first(std::min(packet->length, buffer.size()));
  std::copy(bytes.begin(), bytes.end(), buffer.begin());
  reports_.pop();
  return read;
}

LinkStatus EmulatedLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  if (!open_) return LinkStatus::gone;
  device_.advance_to(now, *this);
  device_.take_command(now, report);
  return LinkStatus::ok;
}

void EmulatedLink::wait_readable(TimePoint deadline) noexcept {
  for (TimePoint now = clock_.now(); open_ && now < deadline; now = clock_.now()) {
    device_.advance_to(now, *this);
    if (reports_.arrived(now) != nullptr) return;
    clock_.sleep_until(std::min(deadline, std::max(device_.next_event(), now + Duration{1})));
  }
}

void EmulatedLink::close() noexcept {
  open_ = false;
  reports_.clear();
}

void EmulatedLink::take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept {
  if (open_ && !reports_.push(sent, report)) ++dropped_;
}

}  // namespace wrenchd
