// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/pace_watch.hpp"

namespace wrenchd {

/// The times of one tick.
struct TickTime {
  std::uint64_t tick = 0;   ///< Number of the tick; 0 is the first.
  TimePoint now{};          ///< Start of the tick on the monotonic clock: the present, for every stage.
  Duration wake_latency{};  ///< From the time the tick was due to its start.
  Duration suspended{};     ///< How long the machine has been suspended since it was switched on.
  double dt_s = 0.0;  ///< Since the previous tick; at most two periods, so nothing that integrates jumps.
  double scene_time_s = 0.0;   ///< Time by which obstacles move: 0 at the first tick.
  FaultSet faults = 0;         ///< What is wrong with the times: late, stalled, reversed, suspended.
  Duration lateness{};         ///< How late this tick is; 0 if it is on time.
  bool recently_late = false;  ///< A tick was late so recently that old reports are the loop's own fault.
};

/// How long each stage of a tick took [ns], in the order of Stage.
using StageTimes = std::array<std::int64_t, kStageCount>;

/// Numbers the ticks, judges their pace and measures their stages. All members are RT-safe.
class TickClock {
 public:
  /// The clock is kept by reference. pace: judges whether ticks come in time.
  TickClock(const Clock& clock, const PaceWatch& pace) noexcept : clock_(clock), pace_(pace) {}

  /// Scene time begins at `start` instead of at the first tick. Without effect after the first tick.
  void start_scene_at(TimePoint start) noexcept;
  /// Starts a tick at `now`, which was due at `due`.
  TickTime begin(TimePoint now, TimePoint due) noexcept;
  /// Ends a stage and returns the time at which it ended.
  TimePoint lap(Stage stage) noexcept;

  const StageTimes& stage_ns() const noexcept { return stage_ns_; }
  /// Time since begin().
  Duration elapsed() const noexcept { return clock_.now() - started_; }

 private:
  const Clock& clock_;
  PaceWatch pace_;
  std::uint64_t ticks_ = 0;               ///< Number of ticks begun so far.
  std::optional<TimePoint> scene_start_;  ///< Scene time 0; empty before the first tick.
  TimePoint started_{};                   ///< Time read in begin().
  TimePoint lap_start_{};                 ///< End of the previous stage.
  StageTimes stage_ns_{};
};

}  // namespace wrenchd
