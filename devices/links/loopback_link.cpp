// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/loopback_link.hpp"

#include <algorithm>
#include <stdexcept>

namespace wrenchd {

using Kind = SimulatedFault::Kind;

namespace {

double value_of(const SimulatedFault& fault) noexcept {
  if (fault.value > 0.0) return fault.value;
  return fault.kind == Kind::lose ? 3.0 : 0.010;
}

}  // namespace

LoopbackLink::LoopbackLink(EmulatedDevice& device, Clock& clock, const SimulationSettings& settings)
    : device_(device),
      clock_(clock),
      report_delay_(from_seconds(settings.report_delay_s)),
      command_delay_(from_seconds(settings.command_delay_s)) {}

void LoopbackLink::open() {
  close();
  const TimePoint now = clock_.now();
  advance_to(now);
  if (device_.shows(Kind::unplug, now, now))
    throw std::runtime_error(
        "simulated device: unplugged by its fault plan; wait until it is plugged in again");
  reports_.clear();
  held_.length = 0;
  last_arrival_ = now;
  passed_ = now;
  state_ = State::open;
}

LinkRead LoopbackLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  advance_to(now);
  stall();
  if (state_ != State::open) return {LinkStatus::gone, 0, now};
  const Packet* packet = reports_.arrived(now);
  if (packet == nullptr) return {LinkStatus::empty, 0, now};
  const LinkRead read{LinkStatus::ok, packet->length, packet->arrives};
  const auto bytes = packet->report().first(std::min(packet->length, buffer.size()));
  std::copy(bytes.begin(), bytes.end(), buffer.begin());
  reports_.pop();
  return read;
}

LinkStatus LoopbackLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  advance_to(now);
  if (state_ != State::open) return LinkStatus::gone;
  if (device_.shows(Kind::deaf, now, now)) return LinkStatus::empty;
  if (!commands_.push(now + command_delay_, report)) return LinkStatus::empty;
  advance_to(now);
  return LinkStatus::ok;
}

void LoopbackLink::wait_readable(TimePoint deadline) noexcept {
  for (TimePoint now = clock_.now(); now < deadline; now = clock_.now()) {
    advance_to(now);
    if (state_ != State::open || reports_.arrived(now) != nullptr) return;
    clock_.sleep_until(std::min(deadline, next_arrival(now)));
  }
}

void LoopbackLink::close() noexcept {
  state_ = State::closed;
  reports_.clear();  // commands in flight still arrive
}

void LoopbackLink::advance_to(TimePoint now) noexcept {
  while (const Packet* command = commands_.arrived(now)) {
    device_.advance_to(command->arrives, *this);
    if (!device_.shows(Kind::unplug, command->arrives, command->arrives) &&
        !device_.shows(Kind::swallow, command->arrives, command->arrives))
      device_.take_command(command->arrives, command->report());
    commands_.pop();
  }
  device_.advance_to(now, *this);
  if (state_ == State::open && device_.shows(Kind::unplug, passed_, now)) state_ = State::gone;
  passed_ = std::max(passed_, now);
}

void LoopbackLink::take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept {
  if (report.size() > kMaxReportBytes) return;
  if (!device_.shows(Kind::freeze, sent, sent) || last_.length == 0) {
    std::copy(report.begin(), report.end(), last_.bytes.begin());
    last_.length = report.size();
  }
  ++sent_;
  if (state_ != State::open || device_.shows(Kind::silence, sent, sent) ||
      device_.shows(Kind::unplug, sent, sent))
    return;
  const FaultPlan& faults = device_.faults();
  if (const SimulatedFault* lose = faults.at(Kind::lose, sent)) {
    const auto one_in = static_cast<std::uint64_t>(value_of(*lose));
    if (sent_ % std::max<std::uint64_t>(one_in, 1) == 0) return;
  }
  Packet packet = last_;
  if (device_.shows(Kind::garble, sent, sent)) packet.bytes[packet.length / 2] ^= 0x10;
  if (device_.shows(Kind::short_report, sent, sent)) packet.length /= 2;
  if (device_.shows(Kind::long_report, sent, sent) && packet.length < Packet::kRoom)
    packet.bytes[packet.length++] = 0;
  if (device_.shows(Kind::wrong_id, sent, sent)) packet.bytes[0] ^= 0x55;
  TimePoint arrives = sent + report_delay_;
  if (const SimulatedFault* late = faults.at(Kind::late, sent)) arrives += from_seconds(value_of(*late));
  if (device_.shows(Kind::swap, sent, sent) && held_.length == 0) {
    held_ = packet;
    return;
  }
  queue(arrives, packet);
  if (device_.shows(Kind::repeat, sent, sent)) queue(arrives, packet);
  if (held_.length > 0) queue(arrives, held_);
  held_.length = 0;
}

/// Nothing overtakes on a wire: what was late keeps back what follows it.
void LoopbackLink::queue(TimePoint arrives, const Packet& packet) noexcept {
  last_arrival_ = std::max(last_arrival_, arrives);
  if (!reports_.push(last_arrival_, packet.report())) ++dropped_;
}

/// A driver that does not come back: time passes, and nobody can do anything about it.
void LoopbackLink::stall() noexcept {
  const FaultPlan& faults = device_.faults();
  if (const SimulatedFault* stalled = faults.at(Kind::stall, clock_.now()))
    clock_.sleep_until(faults.end_of(*stalled));
}

/// When the next report can be read. Later than now wherever none is waiting.
TimePoint LoopbackLink::next_arrival(TimePoint now) const noexcept {
  if (!reports_.empty()) return reports_.next_arrival();
  return std::max(device_.next_event() + report_delay_, now + Duration{1});
}

}  // namespace wrenchd
