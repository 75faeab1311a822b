// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/emulated_falcon.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr Duration kFalconFrame = std::chrono::milliseconds(1);
constexpr std::size_t kPacket = 16;
constexpr std::size_t kShortPacket = 14;
constexpr std::uint8_t kStartMarker = '<', kEndMarker = '>', kNibble = 'A';
constexpr unsigned kHomingBit = 1;

int decode_word(std::span<const std::uint8_t> nibbles) noexcept {
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
    if (up && !dtr_) {  // the rising edge resets the processor into its boot loader
      state_ = State::awaiting_handshake;
      homed_ = homing_ = false;
      firmware_.clear();
      handshake_bytes_.clear();
    }
    dtr_ = up;
  }
  if (request == kFtdiReset) reply_bytes_.clear();
  if (request != kFtdiBaudRate) return;
  divisor_ = value;
  if (value == kFtdiPacketSpeed && state_ == State::loading && !firmware_.empty()) state_ = State::running;
}

void EmulatedFalcon::write(std::span<const std::uint8_t> bytes) {
  if (state_ == State::running) {
    if (!take_command({}, bytes)) return;
    const std::array<std::uint8_t, kPacket> answer = packet();
    reply_bytes_.assign(answer.begin(), answer.end());
    reply_due_ = false;
    return;
  }
  if (state_ == State::loading && echoes_to_corrupt_ > 0) {
    --echoes_to_corrupt_;
    reply_bytes_.assign(bytes.begin(), bytes.end());
    reply_bytes_.back() ^= 0x40;
    return;
  }
  for (const std::uint8_t byte : bytes) take_serial(byte);
}

/// At 9600 baud three bytes are the handshake. At the baud rate of the loader an 'A' asks whether it is
/// ready; then the firmware follows, and the loader echoes each byte.
void EmulatedFalcon::take_serial(std::uint8_t byte) {
  if (state_ == State::awaiting_handshake && dtr_ && divisor_ == kFtdi9600Baud) {
    handshake_bytes_.push_back(byte);
    if (handshake_bytes_.size() > kFalconHandshake.size()) handshake_bytes_.erase(handshake_bytes_.begin());
    if (!std::equal(handshake_bytes_.begin(), handshake_bytes_.end(), kFalconHandshake.begin(),
                    kFalconHandshake.end()))
      return;
    handshake_bytes_.clear();
    if (handshakes_to_ignore_ > 0)
      --handshakes_to_ignore_;
    else
      reply_bytes_.assign(kFalconHandshakeReply.begin(), kFalconHandshakeReply.end());
    return;
  }
  if (divisor_ != kFtdiLoaderSpeed || dtr_) return;
  if (state_ == State::awaiting_handshake && byte == kNibble) {
    state_ = State::loading;
    reply_bytes_.push_back(byte);
  } else if (state_ == State::loading) {
    firmware_.push_back(byte);
    reply_bytes_.push_back(byte);
  }
}

std::vector<std::uint8_t> EmulatedFalcon::read(std::size_t max_bytes) {
  const auto count = static_cast<std::ptrdiff_t>(std::min(max_bytes, reply_bytes_.size()));
  std::vector<std::uint8_t> bytes(reply_bytes_.begin(), reply_bytes_.begin() + count);
  reply_bytes_.erase(reply_bytes_.begin(), reply_bytes_.begin() + count);
  return bytes;
}

// --- running ----------------------------------------------------------------------------------------------

void EmulatedFalcon::perform_homing_motion() noexcept {
  if (homing_) homed_ = true;
}

void EmulatedFalcon::set_counts(const JointCounts& counts) noexcept {
  for (std::size_t i = 0; i < true_counts_.size(); ++i)
    true_counts_[i] = static_cast<int>(std::lround(counts[i]));
}

MotorEfforts EmulatedFalcon::motor_efforts() const noexcept {
  return {static_cast<double>(efforts_[0]), static_cast<double>(efforts_[1]),
          static_cast<double>(efforts_[2])};
}

void EmulatedFalcon::start() {
  constexpr std::array<std::uint8_t, 256> kPlaceholder{};
  if (state_ != State::running) falcon_start(*this, kPlaceholder);
}

bool EmulatedFalcon::take_command(TimePoint, std::span<const std::uint8_t> bytes) noexcept {
  if (state_ != State::running || bytes.size() != kPacket || bytes.front() != kStartMarker ||
      bytes.back() != kEndMarker)
    return false;
  for (std::size_t i = 0; i < 3; ++i)
    efforts_[i] = std::clamp(decode_word(bytes.subspan(1 + 4 * i, 4)), -kMaxEffort, kMaxEffort);
  const unsigned bits = bytes[13] - unsigned{kNibble};
  homing_ = (bits & kHomingBit) != 0;
  homed_ = homed_ && homing_;  // homing ends when the host leaves homing mode
  reply_due_ = true;
  return true;
}

void EmulatedFalcon::advance_to(TimePoint t, ReportSink& host) noexcept {
  if (!powered_) {
    powered_ = true;
    next_frame_ = t;
    faults_.power_on(t);
  }
  for (; next_frame_ <= t; next_frame_ += kFalconFrame)
    if (reply_due_) send(host);
}

std::array<std::uint8_t, 16> EmulatedFalcon::packet() const noexcept {
  std::array<std::uint8_t, kPacket> packet;
  packet.fill(kNibble);
  packet.front() = kStartMarker;
  packet.back() = kEndMarker;
  for (std::size_t i = 0; i < 3; ++i)
    put_word(std::span(packet).subspan(1 + 4 * i, 4), true_counts_[i] - (homed_ ? 0 : power_on_counts_[i]));
  packet[13] = static_cast<std::uint8_t>(kNibble + buttons_ + (homed_ ? 0x70u : 0u));
  return packet;
}

void EmulatedFalcon::send(ReportSink& host) noexcept {
  reply_due_ = false;
  const bool truncate = packets_to_truncate_ > 0;
  if (truncate) --packets_to_truncate_;
  const std::array<std::uint8_t, kPacket> bytes = packet();
  host.take_report(next_frame_, std::span(bytes).first(truncate ? kShortPacket : kPacket));
}

}  // namespace wrenchd
