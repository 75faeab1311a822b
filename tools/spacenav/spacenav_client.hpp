// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "daemon/control/owned_fd.hpp"
#include "tools/spacenav/axis_rates.hpp"

namespace wrenchd {

/// What a program may ask about the device.
struct SpacenavDevice {
  std::string name;  ///< for example "wrenchd: loopback"
  std::string path;  ///< socket of the daemon
  bool connected = false;
};

/// A program that is connected to the spacenav socket. It speaks the protocol of spacenavd 1.0, version 0
/// (events and sensitivity) or 1 (requests and answers of 32 bytes); see libspnav, src/proto.h. Not RT-safe:
/// system calls.
///
/// A program that does not read loses events, but no motion: the next event that it takes contains what it
/// missed.
class SpacenavClient {
 public:
  explicit SpacenavClient(OwnedFd socket) noexcept : socket_(std::move(socket)) {}

  int fd() const noexcept { return socket_.get(); }

  /// Reads and answers what has arrived. Returns false if the program has gone or breaks the protocol.
  bool serve(const SpacenavDevice& device);
  /// Sends motion of the last dt_s. Returns false if the program has gone.
  bool send_motion(const AxisRates& rates, double dt_s);
  bool send_button(int number, bool pressed);
  bool send_device_change(bool connected);

 private:
  using Words = std::array<std::int32_t, 8>;

  bool answer(Words request, const SpacenavDevice& device);
  bool answer_text(std::int32_t request, const std::string& text);
  void set_sensitivity(std::int32_t bits) noexcept;
  bool send(const Words& words);  ///< true: sent, or not sent at all because the program does not read

  OwnedFd socket_;
  int protocol_ = 0;
  std::int32_t events_wanted_ = 0x3;  ///< motion and buttons
  float sensitivity_ = 1.0F;
  std::array<std::byte, sizeof(Words)> received_{};
  std::size_t received_bytes_ = 0;
  AxisRates unsent_{};     ///< counts times seconds that no event has contained yet
  bool was_sent_ = false;  ///< the last call of send() sent its message
  bool moves_ = false;     ///< the last event had a deflection, so the next one may be zero
};

}  // namespace wrenchd
