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

/// Virtual time that can jump in the middle of a tick, go back, and leave out sleep.
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

  Duration solver_time{};  ///< from the end of the reading to the wrench
  Duration suspended{};

 private:
  /// At the start of the tick, and after the reading.
  static constexpr int kReadsBeforeSolver = 2;

  TimePoint now_{};
  mutable int reads_ = 0;
};

/// A device whose samples and writes are spoiled on their way.
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

/// A placer that finds what it is told to.
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

/// What the hand does when the fault comes.
enum class Phase : std::uint8_t {
  free,       ///< it holds the tool above the table
  contact,    ///< it presses it on the table
  saturated,  ///< it presses harder than the limits let the table push back
};
const char* name(Phase phase);

/// The shipped cube on its table in virtual time, with everything that can go wrong within reach. Every tick
/// is held against the invariants.
class FaultRig {
 public:
  /// adjust: what shall be otherwise in its plan.
  explicit FaultRig(Phase phase, const std::function<void(RunConfig&)>& adjust = {});

  /// One period later, and the tick. Returns what it recorded.
  const TickRecord& tick(Duration after = std::chrono::milliseconds(1));
  /// Ticks until the loop is in this state, while the hand is as the phase says. False where it does not come
  /// to that.
  bool bring_to(State state);

  const TickRecord& last() const noexcept { return last_; }
  State state() const noexcept { return static_cast<State>(last_.state); }
  bool raised(Fault fault) const noexcept { return (last_.faults & bit(fault)) != 0; }
  double force_N() const noexcept;
  /// Which invariant was broken first, and where; empty where none was.
  const std::string& violation() const noexcept { return violation_; }

  /// From now on, for so long.
  void inject(SimulatedFault::Kind kind, double for_s, double value = 0.0);

  RigClock clock;
  RunConfig config;
  std::shared_ptr<const Scene> scene;
  SimulatedDevice simulated;
  LoopbackLink link;
  ProfileDevice device;
  FaultyDevice faulty_device;
  std::shared_ptr<OverriddenProxyInitializer> proxy_initializer;
  ServoLoop loop;

 private:
  TickRecord last_;
  Invariants invariants_;
  std::string violation_;
  bool armed_ = false;
};

/// A fault that can be made to happen, and what has to follow.
struct Injection {
  std::string name;
  Fault expected;
  int within_ticks;  ///< until it is found, from the first tick at which something is wrong
  std::function<void(FaultRig&)> begin;
  std::function<void(FaultRig&)> each_tick = {};
  /// Where it can be found at all.
  std::function<bool(State, Phase)> applies = [](State, Phase) { return true; };
};

/// All of them.
const std::vector<Injection>& injections();

/// The states that a fault can come in.
const std::vector<State>& rig_states();

}  // namespace wrenchd::test
