// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "collision/scene.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/command.hpp"
#include "core/device_profile.hpp"
#include "core/gravity_compensation.hpp"
#include "core/latest_value.hpp"
#include "core/limits.hpp"
#include "core/state_machine.hpp"
#include "core/thermal.hpp"
#include "daemon/servo/contact_stabilizer.hpp"
#include "daemon/servo/event.hpp"
#include "daemon/servo/local_models.hpp"
#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/rendering_crossfade.hpp"
#include "daemon/servo/self_test.hpp"
#include "daemon/servo/shared_state.hpp"
#include "daemon/servo/tick_record.hpp"
#include "daemon/servo/watches.hpp"
#include "daemon/servo/workspace.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// A handle that says nothing for this many periods is looked at all the same, when the device sets the pace.
inline constexpr int kDeviceTimeout_periods = 4;

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
  /// Profile, device and clock are kept by reference; the device is open. rendering: what is felt first.
  ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device,
            std::unique_ptr<Rendering> rendering, const Clock& clock);
  /// The same with a rendering of its own, of a scene and a placer that are kept by reference.
  ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device, const Scene& scene,
            ProxyInitializer& placer, const Clock& clock);

  /// Shows every tick to recorders and to other processes from now on. state must outlive this. Before the
  /// loop runs.
  void publish_to(SharedState& state) noexcept { shown_ = &state; }

  /// Ticks until stop is set and the force has faded, or the device is gone, and releases the hand on every
  /// way out. Faults of every other kind are states in which it goes on. Returns device_lost, or none. clock:
  /// the same as at construction, to sleep on.
  Fault run(Clock& clock, const std::atomic<bool>& stop) noexcept;

  /// One cycle of the paper's Algorithm 1. Returns the fault that changed the state in it, device_lost where
  /// the device is gone; after that the next tick is that of a device which was opened anew. RT safe.
  Fault tick(TimePoint now, TimePoint due) noexcept;

  /// The way out that waits for nothing: zero wrench, motors off, whatever the state. Harmless when called
  /// again. RT safe.
  void release(TimePoint now) noexcept;

  /// Asks for something at the next tick. Any thread.
  void request(CommandSet commands) noexcept { commands_.fetch_or(commands, std::memory_order_relaxed); }
  /// By somebody who is there for as long as the process is: the command line.
  void arm() noexcept { request(kArm); }
  /// By somebody who has to call live() at least every 100 ms from now on.
  void arm_with_lease() noexcept { request(kArm | kLease | kHeartbeat); }
  void heartbeat() noexcept { request(kHeartbeat); }
  /// Who armed so is gone, and cannot say so itself: the force fades now. Who armed without is not meant.
  void client_lost() noexcept { request(kClientLost); }
  void disarm() noexcept { request(kDisarm); }
  void stop() noexcept { request(kStop); }
  void acknowledge() noexcept { request(kAcknowledge); }

  /// Says that last tick's q means nothing any more: the tool or the scene was changed, an obstacle was put
  /// where the tool is. From the next tick on there is no contact force until the placer has found an
  /// admissible pose near the hand, and then the soft start runs again. Arming does the same by itself. Any
  /// thread.
  void reinitialize_proxy() noexcept { request(kReinitialize); }

  /// Where another rendering is handed over, to be felt from one of the next ticks on without a jump
  /// (daemon/servo/rendering_crossfade.hpp). One thread.
  RenderingExchange& exchange() noexcept { return renderings_.exchange(); }
  /// Another workspace (daemon/servo/workspace.hpp), from the next tick on and without a jump. One thread.
  void set_workspace(const WorkspaceRequest& wish) noexcept { wishes_.write(wish); }
  /// Other limits, from the next tick on. What is tighter holds whatever the state, what is looser only where
  /// nothing can go out: while the loop is armed it is left out. One thread.
  void set_limits(const LimitSettings& limits) noexcept { new_limits_.write(limits); }
  /// What clients know of the surroundings of the handle, all of it, from the next tick on. A profile whose
  /// wrench is not about the handle knows none. One thread.
  void set_local_models(const LocalModelSet& models) noexcept { new_models_.write(models); }
  /// Where the handle was in the world at the last tick, and when. One thread.
  struct HandlePose {
    Pose X_WH;
    double scene_time_s = 0.0;
    TimePoint at{};
  };
  HandlePose handle_pose() noexcept {
    whereabouts_.read(last_seen_);
    return last_seen_;
  }

  /// As of the last tick. Any thread.
  State state() const noexcept { return seen_state_.load(std::memory_order_relaxed); }
  /// What led to it.
  Fault cause() const noexcept { return seen_cause_.load(std::memory_order_relaxed); }
  /// Number of the rendering that is felt, and whether another is on its way in its place.
  std::uint32_t rendering_id() const noexcept { return seen_rendering_.load(std::memory_order_relaxed); }
  bool crossfading() const noexcept { return seen_changing_.load(std::memory_order_relaxed); }
  const LoopTiming& timing() const noexcept { return timing_; }
  LatestValue<TickRecord>& latest_record() noexcept { return latest_; }
  EventRing& events() noexcept { return events_; }
  std::uint64_t dropped_events() const noexcept { return dropped_events_.load(std::memory_order_relaxed); }

 private:
  void begin(TimePoint now, TimePoint due) noexcept;
  void look(const DeviceSample& sample, TimePoint now) noexcept;
  void obey(CommandSet commands, TimePoint now) noexcept;
  void heed_buttons(std::uint32_t buttons) noexcept;
  void take_changes(TimePoint now) noexcept;
  void change_rendering() noexcept;
  void scale_renderings() noexcept;
  void change_workspace(const WorkspaceRequest& wish) noexcept;
  void change_limits(LimitSettings asked) noexcept;
  void let_through() noexcept;
  void project(const DeviceSample& sample) noexcept;
  std::optional<Pose> held() const noexcept;
  void compute_wrench(const DeviceSample& sample) noexcept;
  void check_answer(const DeviceSample& sample, TimePoint now) noexcept;
  void settle_stiffness(TimePoint now) noexcept;
  Limited limit(const DeviceSample& sample, TimePoint now) noexcept;
  void send(TimePoint now, Limited& out) noexcept;
  void hand_over(TimePoint now, const Wrench& F, bool motors_on) noexcept;
  void let_go(TimePoint now) noexcept;
  void finish(TimePoint now, const Limited& out) noexcept;
  void describe(const Limited& out) noexcept;
  void publish() noexcept;
  Touches touches() const noexcept;

  void test(const DeviceSample& sample, TimePoint now) noexcept;
  void found(FaultSet faults, TimePoint now, double value = 0.0) noexcept;
  void found(Fault fault, TimePoint now, double value = 0.0) noexcept;
  Wrench outgoing(const Rendering& rendering) const noexcept;
  Wrench feel_local_models(const DeviceSample& sample) noexcept;
  bool calm(const DeviceSample& sample) const noexcept;
  void lose_place() noexcept;
  const Rendering& felt() const noexcept { return renderings_.active(); }
  void lap(Stage stage) noexcept;
  void say(Event::Kind kind, TimePoint at, std::uint32_t detail = 0, double value = 0.0) noexcept;
  void say_changes(TimePoint now) noexcept;
  void say_placing(TimePoint now) noexcept;
  void record_sample(const DeviceSample& sample) noexcept;
  TimePoint wait_for_next(Clock& clock, TimePoint due) noexcept;

  // Constant after construction
  const DeviceProfile& profile_;
  Device& device_;
  const Clock& clock_;
  SharedState* shown_ = nullptr;
  WrenchPoint wrench_point_;
  DofMask driven_;
  Pacing pacing_;
  Duration period_;

  // The state of the rendering
  RenderingCrossfade renderings_;
  Workspace workspace_;
  LocalModels models_;
  LocalModels::Evaluation modelled_;
  double models_share_ = 1.0;  ///< that the device bears of them
  GravityCompensation gravity_;
  LimitSettings limit_settings_;
  WrenchLimits limits_;
  ThermalModel heat_;

  ContactStabilizer steady_;
  Wrench F_out_;  ///< of the law chosen, as the device wants it, before limits
  Twist V_hand_;  ///< last that were numbers
  Vector3d hand_m_ = Vector3d::Zero();
  Wrench F_weight_;           ///< that holds the handle's weight, likewise
  DofMask dropped_ = kNoDof;  ///< what of them the device has no motors for; it is not in them
  double through_ = 1.0;      ///< the share of the contact's wrench that is let through
  bool shut_ = false;         ///< it goes to 0, else to 1
  bool recentres_ = false;    ///< once it is there
  std::uint32_t recentred_ = 0;
  std::uint32_t buttons_ = 0;   ///< of the last tick
  std::uint32_t changes_ = 0;   ///< from outside, since the start
  double sample_time_s_ = 0.0;  ///< device time of the last fresh sample
  bool sampled_ = false;
  bool good_ = false;         ///< this tick has a new pose that may be used
  int failures_ = 0;          ///< ticks in a row without an admissible pose
  bool motors_told_ = false;  ///< the last command said motors on

  // What is wrong, and what follows
  Watches watches_;
  SelfTest self_test_;
  bool testing_ = false;
  StateMachine machine_;
  FaultSet found_ = 0;              ///< in this tick
  FaultSet found_before_ = 0;       ///< in the last
  Fault changed_by_ = Fault::none;  ///< the fault that changed the state in this tick

  // Book-keeping
  TimePoint now_{};  ///< of this tick
  TimePoint first_tick_{};
  bool ticked_ = false;
  double scene_time_s_ = 0.0;  ///< of this tick
  double dt_s_ = 0.0;
  TimePoint tick_start_{};
  TimePoint lap_start_{};
  TickRecord record_;
  State said_state_ = State::disconnected;
  ProjectionStatus said_status_ = ProjectionStatus::free;
  bool said_placed_ = true;
  bool said_nowhere_ = false;
  LatestValue<WorkspaceRequest> wishes_;
  LatestValue<LimitSettings> new_limits_;
  LatestValue<LocalModelSet> new_models_;
  LatestValue<HandlePose> whereabouts_;
  HandlePose last_seen_;  ///< belongs to its reader
  std::atomic<CommandSet> commands_{kNoCommand};
  std::atomic<State> seen_state_{State::disconnected};
  std::atomic<Fault> seen_cause_{Fault::none};
  std::atomic<std::uint32_t> seen_rendering_{0};
  std::atomic<bool> seen_changing_{false};
  LoopTiming timing_;
  LatestValue<TickRecord> latest_;
  EventRing events_;
  std::atomic<std::uint64_t> dropped_events_{0};
};

}  // namespace wrenchd
