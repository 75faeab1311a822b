// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/usbip_device.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <utility>

#include "devices/simulation/reference_profile.hpp"
#include "tests/support/ideal_encoders.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test {
namespace {

/// Returns the number of the pose that the force in x encodes.
constexpr double kAnswerStep_N = 1e-6;

}  // namespace

/// A periodic motion of 1 um per report, so that the speed is valid at any rate.
double UsbipDevice::position_m(std::uint64_t sequence) noexcept {
  const std::uint64_t phase = sequence & 0xFFFFU;
  return 1e-6 * static_cast<double>(phase < 0x8000U ? phase : 0x10000U - phase);
}

Wrench UsbipDevice::answer_to(std::uint64_t sequence) noexcept {
  Wrench F;
  F.force_N.x() = kAnswerStep_N * static_cast<double>(sequence & 0xFFFFU);
  return F;
}

UsbipDevice::UsbipDevice(Identity identity, double rate_Hz, int priority)
    : UsbipPort(std::move(identity), {.report_descriptor = reference_descriptor()}, priority),
      period_(from_seconds(1.0 / rate_Hz)),
      profile_(reference_profile()),
      firmware_(profile_, ideal_encoders(), period_) {
  turn_arounds_.reserve(65536);
}

UsbipDevice::~UsbipDevice() {
  unplug();
}

void UsbipDevice::set(Trouble trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  halted_ = trouble == Trouble::stalled_once || trouble == Trouble::stalled;
  if (trouble != Trouble::blocked) take_held_commands();
  flush();
}

DeviceRecord UsbipDevice::record() const {
  const std::lock_guard lock(mutex_);
  DeviceRecord record = record_;
  record.motors_on = firmware_.motors_on();
  record.watchdog_tripped = firmware_.watchdog_tripped();
  return record;
}

std::vector<Duration> UsbipDevice::turn_arounds() const {
  const std::lock_guard lock(mutex_);
  return turn_arounds_;
}

// --- host -----------------------------------------------------------------------------------

TimePoint UsbipDevice::begin(TimePoint now) {
  powered_ = now;
  return next_ = now + period_;
}

TimePoint UsbipDevice::on_time(TimePoint now) {
  const auto ticks = static_cast<std::uint64_t>((now - next_) / period_) + 1;
  tick(ticks, now);
  return next_ += static_cast<std::int64_t>(ticks) * period_;
}

void UsbipDevice::on_out(Transfer transfer) {
  if (trouble_ == Trouble::blocked) {
    held_out_.push_back(std::move(transfer));
    return;
  }
  reply(transfer.number, 0, transfer.length, {});
  take_command(transfer.data);
}

void UsbipDevice::on_clear_halt() {
  halted_ = trouble_ == Trouble::stalled;
  ++record_.halts_cleared;
}

// --- firmware -----------------------------------------------------------------------------------------

void UsbipDevice::tick(std::uint64_t ticks, TimePoint now) {
  record_.late_ticks += ticks - 1;
  firmware_.skip_reports(static_cast<std::uint32_t>(ticks - 1));
  firmware_.motor_wrench(now);  // the watchdog
  PoseReport report = firmware_.make_report(now - powered_);
  report.X_BH = {};
  report.X_BH.translation_m.x() = position_m(report.sequence);
  ++record_.made;

  if (trouble_ != Trouble::frozen || newest_.bytes.empty()) {
    newest_.sequence = static_cast<std::uint32_t>(report.sequence);
    newest_.bytes.resize(profile_.pose_report.length);
    encode(profile_.pose_report, report, newest_.bytes);
  }
  outbox_.clear();  // newest only
  if (trouble_ == Trouble::silent) return;
  if (in_.empty()) ++record_.unprepared;
  outbox_.push_back(newest_);
  if (trouble_ == Trouble::duplicates) outbox_.push_back(newest_);
  if (trouble_ == Trouble::short_reports) outbox_.back().bytes.resize(newest_.bytes.size() / 2);
  if (trouble_ == Trouble::garbled) outbox_.back().bytes[20] ^= 0x10U;
  flush();
}

/// Answers pending transfers with queued reports. A halted endpoint answers with a stall.
void UsbipDevice::flush() {
  while (halted_ && !in_.empty()) {
    reply(in_.front().number, -EPIPE, 0, {});
    in_.pop_front();
  }
  while (!in_.empty() && !outbox_.empty()) {
    const Outgoing& out = outbox_.front();
    sent_at_[out.sequence % sent_at_.size()] = std::chrono::steady_clock::now();
    const auto length = std::min<std::size_t>(out.bytes.size(), in_.front().length);
    reply(in_.front().number, 0, static_cast<std::uint32_t>(length), std::span(out.bytes).first(length));
    ++record_.sent;
    in_.pop_front();
    outbox_.pop_front();
  }
}

void UsbipDevice::take_command(std::span<const std::uint8_t> data) {
  const TimePoint now = std::chrono::steady_clock::now();
  ++record_.out_reports;
  const auto [outcome, report] = decode(profile_.wrench_report, data);
  if (outcome == Decoding::ok) record_.last = report;
  if (!firmware_.take_command(now, data)) {
    ++record_.rejected;
    return;
  }
  ++record_.commands;
  if (!report.enable) return;
  const auto answered = static_cast<std::size_t>(std::llround(report.F.force_N.x() / kAnswerStep_N));
  const Duration passed = now - sent_at_[answered % sent_at_.size()];
  ++record_.answers;
  if (turn_arounds_.size() < turn_arounds_.capacity()) turn_arounds_.push_back(passed);
}

void UsbipDevice::take_held_commands() {
  for (; !held_out_.empty(); held_out_.pop_front()) {
    reply(held_out_.front().number, 0, held_out_.front().length, {});
    take_command(held_out_.front().data);
  }
}

}  // namespace wrenchd::test
