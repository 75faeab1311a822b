// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "core/latest_value.hpp"
#include "core/limits.hpp"
#include "daemon/servo/contact_stabilizer.hpp"
#include "daemon/servo/demand.hpp"
#include "daemon/servo/device_port.hpp"
#include "daemon/servo/event.hpp"
#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/loop_totals.hpp"
#include "daemon/servo/rendering.hpp"
#include "daemon/servo/shared_state.hpp"
#include "daemon/servo/supervisor.hpp"
#include "daemon/servo/tick_record.hpp"
#include "daemon/servo/wait_reason.hpp"

namespace wrenchd {

/// Pose of the handle and of the free bodies in the world, and when they were there.
struct HandlePose {
  Pose X_WH;
  BodyPoses X_WB = {};
  double scene_time_s = 0.0;
  TimePoint at{};
};

/// Everything that a tick computed, for its record.
struct TickResult {
  const TickTime& time;
  const DeviceReading& reading;
  const Demand& demand;
  const Authority& authority;
  const Written& written;
  const Requests& asked;
  std::uint16_t limit_causes = kNotLimited;  ///< LimitCause bits.
  std::uint32_t change_count = 0;            ///< Changes made on request since the start.
  TimePoint wrench_ready{};                  ///< When the wrench was computed, before limits.
  StageTimes stage_ns{};
  const StiffnessScale& stiffness_scale;
  const ContactStabilizer& stabilizer;
  const OutputStage::External& external;
  bool released = false;  ///< The hand was released in this tick.
};

/// Shows other threads and processes what the loop does: the record of each tick, state, events and times.
/// The servo thread publishes; readers never make it wait.
class Telemetry {
 public:
  // --- the servo thread: RT-safe ---

  /// Writes the record of a tick, and emits the events of what changed since the previous record.
  void publish(const TickResult& tick, const Supervisor& supervisor, const Rendering& rendering) noexcept;
  /// Publishes the previous record once more, after a release from outside of a tick: zero wrench, motors
  /// off.
  void publish_release(TimePoint now, const Supervisor& supervisor, const Demand& demand,
                       const Rendering& rendering) noexcept;
  /// Adds the times of a tick to the histograms.
  void count_times(const TickTime& time, const StageTimes& stage_ns, Duration elapsed) noexcept;
  /// Counts ticks that were skipped because the one before took too long.
  void count_overrun(std::uint64_t skipped_ticks) noexcept;
  /// Shows the limits that hold from now on.
  void show_limits(const LimitSettings& limits) noexcept;
  EventQueue& events() noexcept { return events_; }

  // --- readers ---

  /// From now on every record also goes to this memory, which outlives the loop. Call before the loop runs.
  void publish_to(SharedState& state) noexcept { shared_state_ = &state; }
  /// State after the last tick. Any thread.
  State state() const noexcept { return state_.load(std::memory_order_relaxed); }
  /// Fault that led to the state. Any thread.
  Fault cause() const noexcept { return cause_.load(std::memory_order_relaxed); }
  /// Number of the active rendering. Any thread.
  std::uint32_t rendering_id() const noexcept { return rendering_id_.load(std::memory_order_relaxed); }
  /// Another rendering is being faded in. Any thread.
  bool crossfading() const noexcept { return crossfading_.load(std::memory_order_relaxed); }
  /// Number of events that no reader took in time. Any thread.
  std::uint64_t dropped_events() const noexcept { return events_.dropped(); }
  /// Any thread.
  const LoopTiming& timing() const noexcept { return timing_; }
  /// Totals over all ticks. Any thread.
  const LoopTotals& totals() const noexcept { return totals_; }
  /// The limits that hold in the loop now, those of the profile included. Any thread.
  LimitSettings limits() const noexcept;
  /// The newest record. One thread.
  LatestValue<TickRecord>& latest_record() noexcept { return latest_record_; }
  /// What the loop waits for. Its numbers may be of two ticks. Any thread.
  WaitReason wait_reason() const noexcept;
  /// Where the handle was in the last tick with a usable sample. One thread.
  HandlePose handle_pose() noexcept {
    handle_pose_.read(last_handle_pose_);
    return last_handle_pose_;
  }

 private:
  void emit_changes(const Supervisor& supervisor, TimePoint now) noexcept;
  void emit_proxy_changes(const Demand& demand, TimePoint now) noexcept;
  void show_wait(State state, const WaitReason& reason, TimePoint now) noexcept;
  void show(const Rendering& rendering, bool crossfading) noexcept;
  void show(const WaitReason& reason) noexcept;

  EventQueue events_;
  SharedState* shared_state_ = nullptr;
  TickRecord record_;  ///< The last record, for a release from outside of a tick.
  State reported_state_ = State::disconnected;
  ProjectionStatus reported_status_ = ProjectionStatus::free;
  bool reported_proxy_valid_ = true;
  bool reported_search_failed_ = false;
  bool waiting_ = false;         ///< The loop waited in the previous tick.
  TimePoint wait_reported_{};    ///< When the wait began, or was reported last.
  unsigned reported_waits_ = 0;  ///< Kinds that were reported in this wait, one bit each.

  std::atomic<State> state_{State::disconnected};
  std::atomic<Fault> cause_{Fault::none};
  std::atomic<std::uint32_t> rendering_id_{0};
  std::atomic<bool> crossfading_{false};
  std::array<std::atomic<double>, 5> limits_{};  ///< Members of LimitSettings in their order.
  LoopTiming timing_;
  LoopTotals totals_;
  LatestValue<TickRecord> latest_record_;
  std::atomic<WaitReason::Kind> wait_kind_{WaitReason::Kind::none};
  std::atomic<Fault> wait_fault_{Fault::none};
  std::array<std::atomic<double>, 6> wait_numbers_{};  ///< Other members of WaitReason in their order.
  LatestValue<HandlePose> handle_pose_;
  HandlePose last_handle_pose_;  ///< Belongs to the reader of handle_pose().
};

}  // namespace wrenchd
