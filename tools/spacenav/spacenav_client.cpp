// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/spacenav/spacenav_client.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include <sys/socket.h>

namespace wrenchd {
namespace {

// Numbers of the protocol of spacenavd 1.0.
enum EventKind : std::int32_t { kMotion = 0, kPress = 1, kRelease = 2, kDevice = 3 };
enum EventBit : std::int32_t { kMotionBit = 1, kButtonBit = 2, kDeviceBit = 4 };
enum Request : std::int32_t {
  kSetName = 0x1000,
  kSetSensitivity = 0x1001,
  kGetSensitivity = 0x1002,
  kSetEvents = 0x1003,
  kGetEvents = 0x1004,
  kDeviceName = 0x2000,
  kDevicePath = 0x2001,
  kDeviceAxes = 0x2002,
  kDeviceButtons = 0x2003,
};
constexpr std::uint32_t kProtocolChange = 0x7faa5500;  ///< a NaN as sensitivity; the last byte is the version
constexpr std::int32_t kNewestProtocol = 1;
constexpr std::size_t kStatus = 7;  ///< index of the status in an answer, and of the period in an event
constexpr std::int32_t kDone = 0, kRejected = -1;
constexpr std::size_t kTextBytes = 24;  ///< text in one packet
constexpr std::int32_t kContinued = 0x10000;
constexpr std::int32_t kButtons = 32;
/// Messages that one call handles, so that a program that floods the socket does not hold up the others.
constexpr int kMessagesAtOnce = 64;
constexpr double kMostCounts = 32767.0;

}  // namespace

bool SpacenavClient::serve(const SpacenavDevice& device) {
  for (int i = 0; i < kMessagesAtOnce; ++i) {
    const std::size_t wanted = protocol_ == 0 ? sizeof(std::int32_t) : sizeof(Words);
    const ssize_t got =
        ::recv(fd(), received_.data() + received_bytes_, wanted - received_bytes_, MSG_DONTWAIT);
    if (got < 0) return errno == EAGAIN || errno == EINTR;
    if (got == 0) return false;
    received_bytes_ += static_cast<std::size_t>(got);
    if (received_bytes_ < wanted) continue;
    received_bytes_ = 0;
    Words words{};
    std::memcpy(words.data(), received_.data(), wanted);
    if (protocol_ > 0) {
      if (!answer(words, device)) return false;
      continue;
    }
    if ((static_cast<std::uint32_t>(words[0]) & 0xffffff00U) != kProtocolChange) {
      set_sensitivity(words[0]);
      continue;
    }
    protocol_ = std::min(words[0] & 0xff, kNewestProtocol);
    if (protocol_ > 0) events_wanted_ |= kDeviceBit;
    const std::int32_t chosen = static_cast<std::int32_t>(kProtocolChange) | protocol_;
    if (::send(fd(), &chosen, sizeof chosen, MSG_DONTWAIT | MSG_NOSIGNAL) != sizeof chosen) return false;
  }
  return true;
}

bool SpacenavClient::answer(Words request, const SpacenavDevice& device) {
  std::int32_t status = device.connected ? kDone : kRejected;
  switch (request[0] & 0xffff) {
    case kSetName:
      return true;  // takes no answer
    case kSetSensitivity:
      set_sensitivity(request[1]);
      status = kDone;
      break;
    case kGetSensitivity:
      std::memcpy(&request[1], &sensitivity_, sizeof sensitivity_);
      status = kDone;
      break;
    case kSetEvents:
      events_wanted_ = request[1];
      status = kDone;
      break;
    case kGetEvents:
      request[1] = events_wanted_;
      status = kDone;
      break;
    case kDeviceName:
      if (device.connected) return answer_text(request[0], device.name);
      break;
    case kDevicePath:
      if (device.connected) return answer_text(request[0], device.path);
      break;
    case kDeviceAxes:
      request[1] = 6;
      break;
    case kDeviceButtons:
      request[1] = kButtons;
      break;
    default:
      status = kRejected;  // settings of spacenavd: wrenchd's own configuration has them
  }
  request[kStatus] = status;
  return send(request);
}

bool SpacenavClient::answer_text(std::int32_t request, const std::string& text) {
  std::size_t at = 0;
  do {
    Words words{request};
    const std::size_t left = text.size() - at;
    std::memcpy(&words[1], text.data() + at, std::min(left, kTextBytes));
    words[kStatus] = static_cast<std::int32_t>(left) | (at > 0 ? kContinued : 0);
    if (!send(words)) return false;
    at += kTextBytes;
  } while (at < text.size());
  return true;
}

void SpacenavClient::set_sensitivity(std::int32_t bits) noexcept {
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  if (std::isfinite(value)) sensitivity_ = value;
}

bool SpacenavClient::send_motion(const AxisRates& rates, double dt_s) {
  if ((events_wanted_ & kMotionBit) == 0) return true;
  Words words{kMotion};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    unsent_[i] += rates[i] * dt_s;
    const double counts =
        std::clamp(static_cast<double>(sensitivity_) * unsent_[i] / dt_s, -kMostCounts, kMostCounts);
    words[i + 1] = static_cast<std::int32_t>(std::lround(counts));
  }
  const bool moves = std::any_of(words.begin() + 1, words.begin() + 7, [](std::int32_t w) { return w != 0; });
  if (!moves && !moves_) return true;
  words[7] = static_cast<std::int32_t>(std::lround(1000.0 * dt_s));
  if (!send(words)) return false;
  if (!was_sent_) return true;
  moves_ = moves;
  for (std::size_t i = 0; i < rates.size(); ++i)
    if (sensitivity_ != 0.0F)
      unsent_[i] -= words[i + 1] * dt_s / static_cast<double>(sensitivity_);
    else
      unsent_[i] = 0.0;
  return true;
}

bool SpacenavClient::send_button(int number, bool pressed) {
  return (events_wanted_ & kButtonBit) == 0 || send({pressed ? kPress : kRelease, number, pressed ? 1 : 0});
}

bool SpacenavClient::send_device_change(bool connected) {
  return protocol_ == 0 || (events_wanted_ & kDeviceBit) == 0 || send({kDevice, connected ? 0 : 1});
}

bool SpacenavClient::send(const Words& words) {
  const ssize_t sent = ::send(fd(), words.data(), sizeof words, MSG_DONTWAIT | MSG_NOSIGNAL);
  was_sent_ = sent == sizeof words;
  return was_sent_ || (sent < 0 && (errno == EAGAIN || errno == EINTR));
}

}  // namespace wrenchd
