// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/emulated_polhem.hpp"

#include <cmath>

namespace wrenchd {
namespace {

constexpr Duration kPolhemFrame = std::chrono::milliseconds(1);
constexpr std::size_t kUsedBytes = 14;
constexpr int kButtonInEncoderD = 10'000;

int word(std::span<const std::uint8_t> bytes, std::size_t i) noexcept {
  return static_cast<std::int16_t>(bytes[2 * i] | (bytes[2 * i + 1] << 8));
}

}  // namespace

void EmulatedPolhem::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = reply_due_ = true;
    faults_.power_on(t);
    next_frame_ = t;
  }
  for (; next_frame_ <= t; next_frame_ += kPolhemFrame) {
    if (amplifiers_on_ && next_frame_ - last_command_at_ >= kWatchdog) {
      amplifiers_on_ = false;
      currents_mA_ = {};
    }
    if (reply_due_) send(host);
  }
}

void EmulatedPolhem::set_counts(const JointCounts& counts) noexcept {
  for (std::size_t i = 0; i < encoder_counts_.size(); ++i)
    encoder_counts_[i] = static_cast<int>(std::lround(counts[i]));
}

MotorEfforts EmulatedPolhem::motor_efforts() const noexcept {
  return {1e-3 * currents_mA_[0], 1e-3 * currents_mA_[1], 1e-3 * currents_mA_[2]};
}

void EmulatedPolhem::send(ReportSink& host) noexcept {
  reply_due_ = false;
  ++reports_sent_;
  std::array<int, 7> words{};
  for (std::size_t i = 0; i < 6; ++i) words[i] = encoder_counts_[i] + counter_offsets_[i];
  if (handle_button_) words[3] += kButtonInEncoderD;
  words[6] = calibration_button_ ? 1 : 0;
  std::array<std::uint8_t, kMaxReportBytes> report{};
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto word = static_cast<std::uint16_t>(words[i]);
    report[2 * i] = static_cast<std::uint8_t>(word & 0xffu);
    report[2 * i + 1] = static_cast<std::uint8_t>(word >> 8);
  }
  host.take_report(next_frame_, std::span(report).first(report_bytes_));
}

bool EmulatedPolhem::take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != report_bytes_ || bytes.size() < kUsedBytes) return false;
  reply_due_ = true;
  last_command_at_ = now;
  amplifiers_on_ = true;
  currents_mA_ = {};
  if (word(bytes, 3) ==
      1) {  // the attributes are counters a, b, c; the bytes of the currents are counters d, e, f
    for (std::size_t i = 0; i < 3; ++i) {
      counter_offsets_[i] = word(bytes, 4 + i) - encoder_counts_[i];
      counter_offsets_[3 + i] = word(bytes, i) - encoder_counts_[3 + i];
    }
    calibration_button_ = false;
    return true;
  }
  for (std::size_t i = 0; i < 3; ++i) currents_mA_[i] = word(bytes, i);
  return true;
}

}  // namespace wrenchd
