// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "devices/simulation/reference_profile.hpp"
#include "tests/support/firmware_in_hand.hpp"

namespace wrenchd::test {

/// The firmware in wall time, at the far end of a socket, in a thread.
class FirmwareProcess final : private ReportSink {
 public:
  explicit FirmwareProcess(const SimulationSettings& hand, FirmwareMistakes mistakes = {})
      : device_(reference_profile(), hand, std::move(mistakes)) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends.data()) != 0) throw std::runtime_error("no socket pair");
    far_ = ends[0], near_ = ends[1];
    thread_ = std::thread([this] { live(); });
  }
  ~FirmwareProcess() {
    stop_ = true;
    thread_.join();
    close(far_);
    close(near_);
  }
  FirmwareProcess(const FirmwareProcess&) = delete;
  FirmwareProcess& operator=(const FirmwareProcess&) = delete;
  /// File descriptor of the near end.
  int fd() const { return near_; }
  std::string socket() const { return std::to_string(near_); }
  bool motors_on() const { return motors_on_; }
  /// Largest force of the motors so far.
  double max_force_N() const { return max_force_N_; }
  bool tripped() const { return tripped_; }

 private:
  /// The device is switched on when the program has opened the socket and discarded what waited in it.
  bool opened() const {
    int unread = 0;
    return ioctl(far_, SIOCOUTQ, &unread) == 0 && unread == 0;
  }
  void live() {
    send(far_, "?", 1, MSG_DONTWAIT | MSG_NOSIGNAL);
    while (!stop_ && !opened()) std::this_thread::sleep_for(std::chrono::microseconds(200));
    while (!stop_) {
      device_.advance_to(std::chrono::steady_clock::now(), *this);
      std::array<std::uint8_t, 64> bytes{};
      for (ssize_t n; (n = recv(far_, bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0;)
        device_.take_command(device_.now(), std::span(bytes).first(static_cast<std::size_t>(n)));
      motors_on_ = device_.firmware().motors_on;
      max_force_N_ = device_.max_force_N();
      tripped_ = device_.firmware().watchdog_tripped;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  }
  void take_report(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    send(far_, report.data(), report.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  }

  FirmwareInHand device_;
  int far_ = -1, near_ = -1;
  std::atomic<bool> stop_{false}, motors_on_{false}, tripped_{false};
  std::atomic<double> max_force_N_{0.0};
  std::thread thread_;
};

}  // namespace wrenchd::test
