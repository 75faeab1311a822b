// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <optional>

#include <boost/lockfree/spsc_queue.hpp>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/engagement.hpp"
#include "core/gravity_compensation.hpp"
#include "core/latest_value.hpp"
#include "core/limits.hpp"
#include "core/wrench_law.hpp"
#include "daemon/event.hpp"
#include "daemon/loop_timing.hpp"
#include "daemon/placer.hpp"
#include "daemon/tick_record.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// From the servo thread to the recorder. When it is full, records are counted and dropped.
using RecordRing = boost::lockfree::spsc_queue<TickRecord>;

/// The servo loop: holds the hand and the virtual body together.
///
/// Frames: W world, B device base, H handle point, M mesh of the tool, T body frame of the tool at its centre
/// of mass. p and q are the paper's: the configuration of T that the hand asks for, and its projection.
///
/// Scene time, by which obstacles move, is 0 at the first tick and goes on from there with the times of the
/// ticks, whatever the state of the loop.
///
/// After construction nothing here allocates, locks, logs, throws or waits, but for the sleep in run().
class ServoLoop {
 public:
  /// Everything is kept by reference or copied; the device is open. records may be null: then nothing is
  /// recorded.
  ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device, const Scene& scene,
            Placer& placer, const Clock& clock, RecordRing* records = nullptr);

  /// Ticks until stop is set or a fault ends the loop, and releases the hand on every way out. Returns the
  /// fault. clock: the same as at construction, to sleep on.
  Fault run(Clock& clock, const std::atomic<bool>& stop) noexcept;

  /// One cycle of the paper's Algorithm 1. A fault ends the loop; the hand has been released then. due: when
  /// this tick should have started. RT safe.
  Fault tick(TimePoint now, TimePoint due) noexcept;

  /// The one way out: zero wrench, motors off, whatever the state. Harmless when called again. RT safe.
  Fault release(TimePoint now, Fault why) noexcept;

  /// Asks for arming or disarming at the next tick. Any thread.
  void arm() noexcept { arm_command_.store(1, std::memory_order_relaxed); }
  void disarm() noexcept { arm_command_.store(2, std::memory_order_relaxed); }

  /// Says that last tick's q means nothing any more: the tool or the scene was changed, an obstacle was put
  /// where the tool is. From the next tick on there is no contact force until the placer has found an
  /// admissible pose near the hand, and then the soft start runs again. Arming does the same by itself. Any
  /// thread.
  void start_over() noexcept { start_over_command_.store(1, std::memory_order_relaxed); }

  const LoopTiming& timing() const noexcept { return timing_; }
  LatestValue<TickRecord>& latest() noexcept { return latest_; }
  EventRing& events() noexcept { return events_; }
  std::uint64_t dropped_records() const noexcept { return dropped_records_.load(std::memory_order_relaxed); }
  std::uint64_t dropped_events() const noexcept { return dropped_events_.load(std::memory_order_relaxed); }

 private:
  void begin(TimePoint now, TimePoint due) noexcept;
  void project(const DeviceSample& sample) noexcept;
  void place() noexcept;
  void compute_wrench(const DeviceSample& sample) noexcept;
  Limited limit(const DeviceSample& sample, TimePoint now) noexcept;
  void finish(TimePoint now, const DeviceSample& sample, const Limited& out) noexcept;
  void describe(const Limited& out) noexcept;
  void publish() noexcept;

  Wrench outgoing(const Pose& X_WH) const noexcept;
  bool calm(const DeviceSample& sample) const noexcept;
  void obey_commands() noexcept;
  void lose_place() noexcept;
  bool has_place() const noexcept { return placing_ == Placing::following || placing_ == Placing::placed; }
  void lap(Stage stage) noexcept;
  void say(Event::Kind kind, TimePoint at, std::uint32_t detail = 0, double value = 0.0) noexcept;
  void say_changes(TimePoint now, const DeviceSample& sample) noexcept;
  void say_placing(TimePoint now) noexcept;
  void record_sample(const DeviceSample& sample) noexcept;
  TimePoint wait_for_next(Clock& clock, TimePoint due) noexcept;

  // Constant after construction
  Device& device_;
  Placer& placer_;
  const Clock& clock_;
  RecordRing* records_;
  Pose X_WB_;
  Pose X_HT_;
  WrenchPoint wrench_point_;
  DofMask driven_;
  Pacing pacing_;
  Duration period_;
  Duration late_limit_;

  // The state of the rendering
  PenetrationDepth penetration_;
  bool moves_;  ///< do obstacles?
  SpringLaw spring_;
  double energy_stiffness_per_s2_;
  Inertia M_;
  WrenchLaw law_;
  GravityCompensation gravity_;
  WrenchLimits limits_;
  SoftStart soft_start_;
  Placing placing_ = Placing::seeking;
  Pose X_WQ_;  ///< last tick's projection, the proxy; means nothing unless has_place()
  Pose X_WP_;
  Penetration depth_;
  Wrench F_T_;                  ///< of the law chosen, body frame
  Wrench F_out_;                ///< the same as the device wants it, before limits
  Wrench F_weight_;             ///< that holds the handle's weight, likewise
  DofMask dropped_ = kNoDof;    ///< what of them the device has no motors for; it is not in them
  std::uint32_t question_ = 0;  ///< number of the last one to the placer
  bool asked_ = false;          ///< and it is not answered yet
  TimePoint ask_again_{};       ///< not before then
  double sample_time_s_ = 0.0;  ///< device time of the last fresh sample
  bool sampled_ = false;
  bool stale_ = false;

  // Book-keeping
  TimePoint first_tick_{};
  std::optional<TimePoint> last_tick_;
  double scene_time_s_ = 0.0;  ///< of this tick
  double dt_s_ = 0.0;
  TimePoint tick_start_{};
  TimePoint lap_start_{};
  TickRecord record_;
  Engagement said_engagement_ = Engagement::disarmed;
  bool said_stale_ = false;
  ProjectionStatus said_status_ = ProjectionStatus::free;
  bool said_placed_ = true;
  bool said_nowhere_ = false;
  std::atomic<std::uint8_t> arm_command_{0};
  std::atomic<std::uint8_t> start_over_command_{0};
  LoopTiming timing_;
  LatestValue<TickRecord> latest_;
  EventRing events_;
  std::atomic<std::uint64_t> dropped_records_{0};
  std::atomic<std::uint64_t> dropped_events_{0};
};

}  // namespace wrenchd
