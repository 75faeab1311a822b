// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "collision/scene.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/invariants.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test {

/// Virtual time that can jump within a tick, run backwards, and report a suspend.
class RigClock final : public Clock {
 public:
  TimePoint now() const noexcept override {
    if (++reads_ > kReadsBeforeSolver) return now_ + solver_time;
    return now_;
  }
  void sleep_until(TimePoint t) noexcept override { now_ = std::max(now_, t); }
  Duration time_suspended() const noexcept override { return suspended; }

  void step(Duration d) noexcept {
    now_ += d;
    reads_ = 0;
  }

  Duration solver_time{};  ///< time from the end of the device read to the wrench
  Duration suspended{};

 private:
  /// The loop reads the clock at the start of the tick and after the device read.
  static constexpr int kReadsBeforeSolver = 2;

  TimePoint now_{};
  mutable int reads_ = 0;
};

/// A device whose samples and writes a test can corrupt.
class FaultyDevice final : public Device {
 public:
  explicit FaultyDevice(Device& device) : device_(device) {}

  std::function<void(DeviceSample&)> corrupt;
  Fault write_result = Fault::none;

  void open() override { device_.open(); }
  DeviceSample read_newest(TimePoint now) noexcept override {
    DeviceSample sample = device_.read_newest(now);
    if (corrupt) corrupt(sample);
    return sample;
  }
  Fault write(TimePoint now, const Wrench& F, bool motors_on) noexcept override {
    return write_result != Fault::none ? write_result : device_.write(now, F, motors_on);
  }
  std::uint64_t commands_sent() const noexcept override { return device_.commands_sent(); }
  void release(TimePoint now) noexcept override { device_.release(now); }
  void wait_readable(TimePoint deadline) noexcept override { device_.wait_readable(deadline); }
  void close() noexcept override { device_.close(); }

 private:
  Device& device_;
};

/// A proxy initializer whose result a test can override.
class OverriddenProxyInitializer final : public ProxyInitializer {
 public:
  explicit OverriddenProxyInitializer(const Scene& scene) : initializer_(scene) {}

  bool override_pose = false;
  Pose overriding_pose;

  void request(const ProxyInitializationRequest& question) noexcept override {
    number_ = question.id;
    initializer_.request(question);
  }
  bool take_result(ProxyInitializationResult& answer) noexcept override {
    if (!initializer_.take_result(answer)) return false;
    if (override_pose) answer = {number_, true, overriding_pose, answer.scene_time_s};
    return true;
  }

 private:
  InTickProxyInitializer initializer_;
  std::uint32_t number_ = 0;
};

/// What the hand does when the fault occurs.
enum class Phase : std::uint8_t {
  free,       ///< the hand holds the tool above the table
  contact,    ///< the hand presses the tool on the table
  saturated,  ///< the hand presses harder than the force limit can oppose
};
const char* name(Phase phase);

/// The shipped cube on its table in virtual time, with access to everything that can fail. Checks every tick
/// against the invariants.
class FaultRig {
 public:
  /// adjust: changes the configuration before the rig is built.
  explicit FaultRig(Phase phase, const std::function<void(RunConfig&)>& adjust = {});
  /// One of two hands, which share the clock and the world of the scene.
  FaultRig(RunConfig plan, const HandScene& hand, RigClock& shared_clock);
  /// The configuration of a rig in this phase.
  static RunConfig plan(Phase phase, const std::function<void(RunConfig&)>& adjust = {});

  /// Advances the time and runs one tick, and half a period later one of the other hand, if there is one.
  /// Returns the record of this hand.
  const TickRecord& tick(Duration after = std::chrono::milliseconds(1));
  /// Runs ticks until the loop is in this state, while the hand does what the phase says. Returns false if
  /// the loop does not reach the state.
  bool bring_to(State state);

  const TickRecord& last() const noexcept { return last_; }
  State state() const noexcept { return static_cast<State>(last_.state); }
  bool raised(Fault fault) const noexcept { return (last_.faults & bit(fault)) != 0; }
  double force_N() const noexcept;
  /// Returns the first violated invariant and its tick; empty if there is none.
  const std::string& violation() const noexcept { return violation_; }

  /// Injects a simulated fault from now on, for `for_s` seconds.
  void inject(SimulatedFault::Kind kind, double for_s, double value = 0.0);

  FaultRig* other = nullptr;  ///< the other hand; its tick() does not tick this one
  bool arms_itself = false;   ///< arms once as soon as it can: while the other hand is brought to its state
  RigClock own_clock;
  RigClock& clock;
  RunConfig config;
  std::shared_ptr<const Scene> scene;
  SimulatedDevice simulated;
  LoopbackLink link;
  ProfileDevice device;
  FaultyDevice faulty_device;
  std::shared_ptr<OverriddenProxyInitializer> proxy_initializer;
  ServoLoop loop;

 private:
  FaultRig(RunConfig plan, const HandScene& hand, RigClock* shared_clock);
  void tick_alone(FaultRig* partner);

  TickRecord last_;
  Invariants invariants_;
  std::string violation_;
};

/// A fault that a test can cause, and the expected reaction.
struct Injection {
  std::string name;
  Fault expected;
  int within_ticks;  ///< maximum number of ticks from the first faulty tick to the detection
  std::function<void(FaultRig&)> begin;
  std::function<void(FaultRig&)> each_tick = {};
  /// Returns true if the loop can detect the fault in this state and phase.
  std::function<bool(State, Phase)> applies = [](State, Phase) { return true; };
};

/// Returns all injections.
const std::vector<Injection>& injections();

/// Returns the states in which a fault can occur.
const std::vector<State>& rig_states();

}  // namespace wrenchd::test
