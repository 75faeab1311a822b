// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/emulated_falcon.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr Duration kFrame = std::chrono::milliseconds(1);
constexpr std::size_t kPacket = 16;
constexpr std::size_t kShortPacket = 14;
constexpr std::uint8_t kBegin = '<', kEnd = '>', kNibble = 'A';
constexpr std::array<std::uint8_t, 3> kHello = {0x0a, 0x43, 0x0d};
constexpr std::array<std::uint8_t, 4> kHelloBack = {0x0a, 0x44, 0x2c, 0x0d};
constexpr unsigned kHomingBit = 1;
constexpr unsigned kLights = 0b1110;

int word(std::span<const std::uint8_t> nibbles) noexcept {
  unsigned value = 0;
  for (unsigned i = 0; i < 4; ++i) value |= ((nibbles[i] - unsigned{kNibble}) & 0xfu) << (4 * i);
  return static_cast<std::int16_t>(value);
}

void put_word(std::span<std::uint8_t> nibbles, int value) noexcept {
  for (unsigned i = 0; i < 4; ++i)
    nibbles[i] = static_cast<std::uint8_t>(kNibble + (static_cast<unsigned>(value) >> (4 * i) & 0xfu));
}

}  // namespace

// --- starting ---------------------------------------------------------------------------------------------

void EmulatedFalcon::control(std::uint8_t request, std::uint16_t value) {
  if (request == kFtdiModemControl && (value & 0x0100u) != 0) {
    const bool up = (value & 1u) != 0;
    if (up && !dtr_) {  // the rising edge resets the processor into its loader
      state_ = State::listening;
      homed_ = homing_ = false;
      firmware_.clear();
      heard_.clear();
    }
    dtr_ = up;
  }
  if (request == kFtdiReset) answer_.clear();
  if (request != kFtdiBaudRate) return;
  divisor_ = value;
  if (value == kFtdiPacketSpeed && state_ == State::loading && !firmware_.empty()) state_ = State::running;
}

void EmulatedFalcon::write(std::span<const std::uint8_t> bytes) {
  if (state_ == State::running) {
    if (!take_command({}, bytes)) return;
    const std::array<std::uint8_t, kPacket> answer = packet();
    answer_.assign(answer.begin(), answer.end());
    reply_due_ = false;
    return;
  }
  if (state_ == State::loading && spoilt_ > 0) {
    --spoilt_;
    answer_.assign(bytes.begin(), bytes.end());
    answer_.back() ^= 0x40;
    return;
  }
  for (const std::uint8_t byte : bytes) take_serial(byte);
}

/// Three bytes at 9600 baud are the greeting; at the loader's speed an 'A' asks whether it is ready, and what
/// follows is firmware, each byte echoed.
void EmulatedFalcon::take_serial(std::uint8_t byte) {
  if (state_ == State::listening && dtr_ && divisor_ == kFtdi9600Baud) {
    heard_.push_back(byte);
    if (heard_.size() > kHello.size()) heard_.erase(heard_.begin());
    if (!std::equal(heard_.begin(), heard_.end(), kHello.begin(), kHello.end())) return;
    heard_.clear();
    if (ignored_ > 0)
      --ignored_;
    else
      answer_.assign(kHelloBack.begin(), kHelloBack.end());
    return;
  }
  if (divisor_ != kFtdiLoaderSpeed || dtr_) return;
  if (state_ == State::listening && byte == kNibble) {
    state_ = State::loading;
    answer_.push_back(byte);
  } else if (state_ == State::loading) {
    firmware_.push_back(byte);
    answer_.push_back(byte);
  }
}

std::vector<std::uint8_t> EmulatedFalcon::read(std::size_t most) {
  const auto count = static_cast<std::ptrdiff_t>(std::min(most, answer_.size()));
  std::vector<std::uint8_t> bytes(answer_.begin(), answer_.begin() + count);
  answer_.erase(answer_.begin(), answer_.begin() + count);
  return bytes;
}

// --- running ----------------------------------------------------------------------------------------------

void EmulatedFalcon::pull_out_and_push_in() noexcept {
  if (homing_) homed_ = true;
}

void EmulatedFalcon::set_counts(const JointCounts& counts) noexcept {
  for (std::size_t i = 0; i < turned_.size(); ++i) turned_[i] = static_cast<int>(std::lround(counts[i]));
}

MotorEfforts EmulatedFalcon::motors() const noexcept {
  return {static_cast<double>(efforts_[0]), static_cast<double>(efforts_[1]),
          static_cast<double>(efforts_[2])};
}

void EmulatedFalcon::start() {
  constexpr std::array<std::uint8_t, 256> kStandIn{};
  if (state_ != State::running) falcon_start(*this, kStandIn);
}

bool EmulatedFalcon::take_command(TimePoint, std::span<const std::uint8_t> bytes) noexcept {
  if (state_ != State::running || bytes.size() != kPacket || bytes.front() != kBegin || bytes.back() != kEnd)
    return false;
  for (std::size_t i = 0; i < 3; ++i)
    efforts_[i] = std::clamp(word(bytes.subspan(1 + 4 * i, 4)), -kMostEffort, kMostEffort);
  const unsigned bits = bytes[13] - unsigned{kNibble};
  lights_ = bits & kLights;
  homing_ = (bits & kHomingBit) != 0;
  homed_ = homed_ && homing_;  // it stays homed only while it is asked to
  reply_due_ = true;
  return true;
}

void EmulatedFalcon::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = true;
    next_frame_ = t;
    faults_.power_on(t);
  }
  for (; next_frame_ <= t; next_frame_ += kFrame)
    if (reply_due_) send(host);
}

std::array<std::uint8_t, 16> EmulatedFalcon::packet() const noexcept {
  std::array<std::uint8_t, kPacket> packet;
  packet.fill(kNibble);
  packet.front() = kBegin;
  packet.back() = kEnd;
  for (std::size_t i = 0; i < 3; ++i)
    put_word(std::span(packet).subspan(1 + 4 * i, 4), turned_[i] - (homed_ ? 0 : began_at_[i]));
  packet[13] = static_cast<std::uint8_t>(kNibble + buttons_ + (homed_ ? 0x70u : 0u));
  return packet;
}

void EmulatedFalcon::send(ReportSink& host) noexcept {
  reply_due_ = false;
  const bool cut = short_ > 0;
  if (cut) --short_;
  const std::array<std::uint8_t, kPacket> whole = packet();
  host.take_report(next_frame_, std::span(whole).first(cut ? kShortPacket : kPacket));
}

}  // namespace wrenchd
