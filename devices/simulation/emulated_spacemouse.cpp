// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/emulated_spacemouse.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

constexpr Duration kSplitPeriod = std::chrono::milliseconds(8);
constexpr Duration kCombinedPeriod = std::chrono::milliseconds(16);
constexpr int kZeroPackets = 3;

/// Writes the low 16 bits of each number.
template <class T>
void put(std::span<std::uint8_t> bytes, std::span<const T> numbers) noexcept {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto word = static_cast<std::uint16_t>(numbers[i]);
    bytes[2 * i] = static_cast<std::uint8_t>(word & 0xffu);
    bytes[2 * i + 1] = static_cast<std::uint8_t>(word >> 8);
  }
}

}  // namespace

void EmulatedSpaceMouse::set_deflection(const std::array<int, 6>& counts) noexcept {
  for (std::size_t i = 0; i < counts.size(); ++i) counts_[i] = std::clamp(counts[i], -kFullScale, kFullScale);
  zeros_left_ = kZeroPackets;
}

void EmulatedSpaceMouse::advance_to(TimePoint t, ReportSink& host) noexcept {
  const Duration period = format_ == Format::split ? kSplitPeriod : kCombinedPeriod;
  if (!powered_) {
    powered_ = true;
    faults_.power_on(t);
    next_packet_at_ = t + period;
  }
  for (; next_packet_at_ <= t; next_packet_at_ += period) send(host);
}

void EmulatedSpaceMouse::send(ReportSink& host) noexcept {
  if (sending_stopped_) return;
  send_buttons(host);
  send_keys(host);
  const bool at_rest = std::all_of(counts_.begin(), counts_.end(), [](int c) { return c == 0; });
  if (at_rest && zeros_left_ == 0) return;
  if (at_rest) --zeros_left_;
  const std::span<const int> counts(counts_);
  if (format_ != Format::split) {
    std::array<std::uint8_t, 13> report = {1};
    put(std::span(report).subspan(1), counts);
    host.take_report(next_packet_at_, report);
    return;
  }
  std::array<std::uint8_t, 7> report = {static_cast<std::uint8_t>(rotation_next_ ? 2 : 1)};
  put(std::span(report).subspan(1), counts.subspan(rotation_next_ ? 3 : 0, 3));
  rotation_next_ = !rotation_next_;
  host.take_report(next_packet_at_, report);
}

void EmulatedSpaceMouse::send_buttons(ReportSink& host) noexcept {
  if (buttons_ == buttons_sent_) return;
  buttons_sent_ = buttons_;
  std::array<std::uint8_t, 5> report = {3};
  for (std::size_t i = 0; i < 4; ++i) report[1 + i] = static_cast<std::uint8_t>(buttons_ >> 8 * i & 0xffu);
  host.take_report(next_packet_at_, std::span(report).first(format_ == Format::enterprise ? 5 : 3));
}

void EmulatedSpaceMouse::send_keys(ReportSink& host) noexcept {
  if (format_ != Format::enterprise || keys_ == keys_sent_) return;
  keys_sent_ = keys_;
  std::array<std::uint8_t, 13> report = {0x1c};
  put(std::span(report).subspan(1), std::span<const std::uint16_t>(keys_));
  host.take_report(next_packet_at_, report);
}

bool EmulatedSpaceMouse::take_command(TimePoint, std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != 2 || bytes[0] != 4) return false;
  led_ = (bytes[1] & 1u) != 0;
  return true;
}

}  // namespace wrenchd
