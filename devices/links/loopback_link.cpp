// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/loopback_link.hpp"

#include <algorithm>
#include <stdexcept>

namespace wrenchd {

using Kind = SimulatedFault::Kind;

namespace {

double value_of(const SimulatedFault& fault) noexcept {
  if (fault.value > 0.0) return fault.value;
  return fault.kind == Kind::drop_reports ? 3.0 : 0.010;
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
  if (device_.fault_active_during(Kind::unplug, now, now))
    throw std::runtime_error("simulated device: unplugged by an injected fault; wait until the fault ends");
  reports_.clear();
  swapped_report_.length = 0;
  last_arrival_ = now;
  unplug_checked_until_ = now;
  state_ = State::open;
}

LinkRead LoopbackLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  advance_to(now);
  block_if_stalled();
  if (state_ != State::open) return {LinkStatus::disconnected, 0, now};
  const Packet* packet = reports_.front_if_arrived(now);
  if (packet == nullptr) return {LinkStatus::not_ready, 0, now};
  const LinkRead read{LinkStatus::ok, packet->length, packet->arrives};
  const auto bytes = packet->report().first(std::min(packet->length, buffer.size()));
  std::copy(bytes.begin(), bytes.end(), buffer.begin());
  reports_.pop();
  return read;
}

LinkStatus LoopbackLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  advance_to(now);
  if (state_ != State::open) return LinkStatus::disconnected;
  if (device_.fault_active_during(Kind::reject_commands, now, now)) return LinkStatus::not_ready;
  if (!commands_.push(now + command_delay_, report)) return LinkStatus::not_ready;
  advance_to(now);
  return LinkStatus::ok;
}

void LoopbackLink::wait_readable(TimePoint deadline) noexcept {
  for (TimePoint now = clock_.now(); now < deadline; now = clock_.now()) {
    advance_to(now);
    if (state_ != State::open || reports_.front_if_arrived(now) != nullptr) return;
    clock_.sleep_until(std::min(deadline, next_arrival(now)));
  }
}

void LoopbackLink::close() noexcept {
  state_ = State::closed;
  reports_.clear();  // commands in transit still arrive
}

void LoopbackLink::advance_to(TimePoint now) noexcept {
  while (const Packet* command = commands_.front_if_arrived(now)) {
    device_.advance_to(command->arrives, *this);
    if (!device_.fault_active_during(Kind::unplug, command->arrives, command->arrives) &&
        !device_.fault_active_during(Kind::drop_commands, command->arrives, command->arrives))
      device_.take_command(command->arrives, command->report());
    commands_.pop();
  }
  device_.advance_to(now, *this);
  if (state_ == State::open && device_.fault_active_during(Kind::unplug, unplug_checked_until_, now))
    state_ = State::disconnected;
  unplug_checked_until_ = std::max(unplug_checked_until_, now);
}

void LoopbackLink::take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept {
  if (report.size() > kMaxReportBytes) return;
  if (!device_.fault_active_during(Kind::freeze, sent, sent) || last_report_.length == 0) {
    std::copy(report.begin(), report.end(), last_report_.bytes.begin());
    last_report_.length = report.size();
  }
  ++reports_sent_;
  if (state_ != State::open || device_.fault_active_during(Kind::silence, sent, sent) ||
      device_.fault_active_during(Kind::unplug, sent, sent))
    return;
  const FaultPlan& faults = device_.faults();
  if (const SimulatedFault* lose = faults.active_at(Kind::drop_reports, sent)) {
    const auto one_in = static_cast<std::uint64_t>(value_of(*lose));
    if (reports_sent_ % std::max<std::uint64_t>(one_in, 1) == 0) return;
  }
  Packet packet = last_report_;
  if (device_.fault_active_during(Kind::corrupt, sent, sent)) packet.bytes[packet.length / 2] ^= 0x10;
  if (device_.fault_active_during(Kind::short_report, sent, sent)) packet.length /= 2;
  if (device_.fault_active_during(Kind::long_report, sent, sent) && packet.length < Packet::kMaxBytes)
    packet.bytes[packet.length++] = 0;
  if (device_.fault_active_during(Kind::wrong_id, sent, sent)) packet.bytes[0] ^= 0x55;
  TimePoint arrives = sent + report_delay_;
  if (const SimulatedFault* late = faults.active_at(Kind::delay_reports, sent))
    arrives += from_seconds(value_of(*late));
  if (device_.fault_active_during(Kind::swap, sent, sent) && swapped_report_.length == 0) {
    swapped_report_ = packet;
    return;
  }
  enqueue(arrives, packet);
  if (device_.fault_active_during(Kind::repeat, sent, sent)) enqueue(arrives, packet);
  if (swapped_report_.length > 0) enqueue(arrives, swapped_report_);
  swapped_report_.length = 0;
}

/// Reports stay in order: a delayed report delays its successors.
void LoopbackLink::enqueue(TimePoint arrives, const Packet& packet) noexcept {
  last_arrival_ = std::max(last_arrival_, arrives);
  if (!reports_.push(last_arrival_, packet.report())) ++dropped_;
}

/// Blocks until the stall fault ends, as a driver that does not return.
void LoopbackLink::block_if_stalled() noexcept {
  const FaultPlan& faults = device_.faults();
  if (const SimulatedFault* stalled = faults.active_at(Kind::stall, clock_.now()))
    clock_.sleep_until(faults.end_of(*stalled));
}

/// Returns when the next report can be read. The result is after `now` unless a report is waiting.
TimePoint LoopbackLink::next_arrival(TimePoint now) const noexcept {
  if (!reports_.empty()) return reports_.next_arrival();
  return std::max(device_.next_event() + report_delay_, now + Duration{1});
}

}  // namespace wrenchd
