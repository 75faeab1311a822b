// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Looks at the times of the ticks: late, stopped, back, and a machine that slept in between. RT safe.
class PaceWatch {
 public:
  /// stopped_after: how late a tick has to be to be no late one any more.
  PaceWatch(Duration period, Duration stopped_after) noexcept
      : period_(period), stopped_after_(stopped_after) {}

  /// slept: how long the machine has slept since it was switched on.
  FaultSet look(TimePoint now, Duration slept) noexcept;

  /// Since the last tick [s]: never less than nothing, and after a gap no more than two periods, so that
  /// nothing that grows with time leaps.
  double dt_s() const noexcept { return dt_s_; }
  /// How late this tick is; nothing where it is not.
  Duration late() const noexcept { return late_; }

 private:
  Duration period_;
  Duration stopped_after_;
  std::optional<TimePoint> last_;
  Duration slept_{};
  double dt_s_ = 0.0;
  Duration late_{};
};

}  // namespace wrenchd
