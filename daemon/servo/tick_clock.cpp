// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/tick_clock.hpp"

namespace wrenchd {

TickTime TickClock::begin(TimePoint now, TimePoint due) noexcept {
  started_ = lap_start_ = clock_.now();
  stage_ns_ = {};
  if (!scene_start_) scene_start_ = now;
  TickTime t;
  t.tick = ticks_++;
  t.now = now;
  t.wake_latency = now - due;
  t.suspended = clock_.time_suspended();
  t.faults = pace_.check(now, t.suspended);
  t.lateness = pace_.lateness();
  t.recently_late = pace_.recently_late(now);
  t.dt_s = pace_.dt_s();
  t.scene_time_s = seconds(now - *scene_start_);
  return t;
}

void TickClock::start_scene_at(TimePoint start) noexcept {
  if (!scene_start_) scene_start_ = start;
}

TimePoint TickClock::lap(Stage stage) noexcept {
  const TimePoint ended = clock_.now();
  stage_ns_[static_cast<std::size_t>(stage)] = (ended - lap_start_).count();
  lap_start_ = ended;
  return ended;
}

}  // namespace wrenchd
