// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <mutex>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

namespace wrenchd::test {

/// Exit code of a proof that the machine was too busy to judge; ctest skips it (SKIP_RETURN_CODE).
constexpr int kExitTooBusy = 77;

/// The machine does not give the rate that a proof needs. what() is MachineLoad::busy_text().
class TooBusy : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Measures whether the machine gives programs a rate of 1 kHz. A thread of ordinary priority sleeps to
/// instants 1 ms apart and measures how late it wakes up. The measurement runs from the constructor to the
/// destructor.
///
/// A test that needs a rate in wall time owns one. If a condition that needs the rate does not hold and
/// busy() is true, the test skips with busy_text(). If another condition does not hold, the test fails
/// whatever the load.
class MachineLoad {
 public:
  /// A wake-up is late if it comes more than 2 ms after its instant.
  static constexpr double kLate_ms = 2.0;
  /// The machine is busy if more wake-ups than this share are late: three a second. Beside a program that
  /// uses both cores, the shares were 1.4 to 13 %; the daemon then raises a fault every few seconds.
  static constexpr double kBusyShare = 0.003;
  /// busy() and busy_text() wait until this many instants have passed.
  static constexpr std::size_t kFewestInstants = 1000;

  MachineLoad() : thread_([this](const std::stop_token& stop) { measure(stop); }) {}

  /// Returns true if the machine does not give the rate. May wait 1 s.
  bool busy() const { return figures().late_share > kBusyShare; }

  /// Throws TooBusy if the machine does not give the rate. May wait 1 s.
  void throw_if_busy() const {
    if (busy()) throw TooBusy(busy_text());
  }

  /// Returns "machine too busy to judge: ..." with the measured figures. ctest skips a test that prints this
  /// text.
  std::string busy_text() const {
    const Figures f = figures();
    std::array<char, 200> text{};
    std::snprintf(
        text.data(), text.size(),
        "machine too busy to judge: %.1f %% of %zu wake-ups came more than %.0f ms late, the worst %.1f ms",
        100.0 * f.late_share, f.instants, kLate_ms, f.worst_ms);
    return text.data();
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr auto kPeriod = std::chrono::milliseconds(1);

  struct Figures {
    std::size_t instants = 0;  ///< number of instants that have passed
    double late_share = 0.0;   ///< share of the instants with a late wake-up
    double worst_ms = 0.0;     ///< largest lateness
  };

  /// Instants that pass before a late wake-up count as late too: a program with this rate misses each of
  /// them.
  void measure(const std::stop_token& stop) {
    for (Clock::time_point due = Clock::now() + kPeriod; !stop.stop_requested(); due += kPeriod) {
      std::this_thread::sleep_until(due);
      const double late_ms = std::chrono::duration<double, std::milli>(Clock::now() - due).count();
      const std::lock_guard lock(mutex_);
      ++instants_;
      if (late_ms > kLate_ms) ++late_;
      worst_ms_ = std::max(worst_ms_, late_ms);
    }
  }

  Figures figures() const {
    for (;; std::this_thread::sleep_for(kPeriod)) {
      const std::lock_guard lock(mutex_);
      if (instants_ >= kFewestInstants)
        return {instants_, static_cast<double>(late_) / static_cast<double>(instants_), worst_ms_};
    }
  }

  mutable std::mutex mutex_;
  std::size_t instants_ = 0;  ///< protected by mutex_
  std::size_t late_ = 0;      ///< number of late wake-ups; protected by mutex_
  double worst_ms_ = 0.0;     ///< protected by mutex_
  std::jthread thread_;       ///< last member: it uses all of the above
};

}  // namespace wrenchd::test
