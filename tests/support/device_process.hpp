// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "devices/simulation/emulated_device.hpp"

namespace wrenchd::test {

/// An emulated device in wall time, at the far end of a socket, in a thread.
class DeviceProcess final : private ReportSink {
 public:
  /// The device must outlive the process. Its thread calls `observe` after each step.
  explicit DeviceProcess(
      EmulatedDevice& device, std::function<void()> observe = [] {})
      : device_(device), observe_(std::move(observe)) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends.data()) != 0) throw std::runtime_error("no socket pair");
    far_ = ends[0], near_ = ends[1];
    thread_ = std::thread([this] { live(); });
  }
  ~DeviceProcess() {
    stop_ = true;
    thread_.join();
    close(far_);
    close(near_);
  }
  DeviceProcess(const DeviceProcess&) = delete;
  DeviceProcess& operator=(const DeviceProcess&) = delete;
  /// File descriptor of the near end.
  int fd() const { return near_; }
  std::string socket() const { return std::to_string(near_); }

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
      const TimePoint now = std::chrono::steady_clock::now();
      device_.advance_to(now, *this);
      std::array<std::uint8_t, 64> bytes{};
      for (ssize_t n; (n = recv(far_, bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0;)
        device_.take_command(now, std::span(bytes).first(static_cast<std::size_t>(n)));
      observe_();
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  }
  void take_report(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    send(far_, report.data(), report.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  }

  EmulatedDevice& device_;
  std::function<void()> observe_;
  int far_ = -1, near_ = -1;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace wrenchd::test
