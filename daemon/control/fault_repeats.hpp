// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Limits how often the log repeats a fault that changes no state, such as a late tick while a fault is
/// latched: at most once in kInterval for each fault. Counts the others. Not RT-safe: allocates.
class FaultRepeats {
 public:
  static constexpr Duration kInterval = std::chrono::seconds(60);

  /// The fault was raised at `at` and changed no state. Returns how often it was held back since it was
  /// admitted last; nothing: hold it back too.
  std::optional<std::uint64_t> admit(Fault fault, TimePoint at);

  struct HeldBack {
    Fault fault;
    std::uint64_t count;
  };
  /// Returns the faults that were held back, and forgets them: each fault is admitted at once next time.
  std::vector<HeldBack> take();

 private:
  struct Row {
    std::optional<TimePoint> admitted_at;
    std::uint64_t held_back = 0;
  };
  std::array<Row, kFaultCount> rows_;
};

}  // namespace wrenchd
