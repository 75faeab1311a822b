// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <string>
#include <utility>

#include "devices/simulation/reference_profile.hpp"
#include "tests/support/device_process.hpp"
#include "tests/support/firmware_in_hand.hpp"

namespace wrenchd::test {

/// The firmware in wall time, at the far end of a socket.
class FirmwareProcess final {
 public:
  explicit FirmwareProcess(const SimulationSettings& hand, FirmwareMistakes mistakes = {})
      : device_(reference_profile(), hand, std::move(mistakes)), process_(device_, [this] { observe(); }) {}

  int fd() const { return process_.fd(); }
  std::string socket() const { return process_.socket(); }
  bool motors_on() const { return motors_on_; }
  /// Largest force of the motors so far.
  double max_force_N() const { return max_force_N_; }
  bool tripped() const { return tripped_; }

 private:
  void observe() {
    motors_on_ = device_.firmware().motors_on;
    max_force_N_ = device_.max_force_N();
    tripped_ = device_.firmware().watchdog_tripped;
  }

  FirmwareInHand device_;
  std::atomic<bool> motors_on_{false}, tripped_{false};
  std::atomic<double> max_force_N_{0.0};
  DeviceProcess process_;  // last: its thread uses the other members
};

}  // namespace wrenchd::test
