// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/command.hpp"
#include "core/state_machine.hpp"
#include "daemon/servo/authority.hpp"
#include "daemon/servo/device_port.hpp"
#include "daemon/servo/event.hpp"
#include "daemon/servo/output_stage.hpp"
#include "daemon/servo/renderer.hpp"
#include "daemon/servo/self_test.hpp"
#include "daemon/servo/tick_clock.hpp"
#include "daemon/servo/verdict.hpp"
#include "daemon/servo/watches.hpp"

namespace wrenchd {

/// Decides in which state the loop is and how much force may go out. It is the only writer of the state, in
/// two places a tick: judge(), when the sample is there, and authorise(), when the wrench is known. What is
/// found after that counts in judge() of the next tick. All members but the constructor are RT-safe.
class Supervisor {
 public:
  /// max_force_N, max_torque_Nm: the limits that hold. events outlives the supervisor. Not RT-safe: copies
  /// parts of the profile.
  Supervisor(const Settings& settings, const DeviceProfile& profile, double max_force_N, double max_torque_Nm,
             EventQueue& events);

  /// First place: what is wrong with times, device, sample and the last write; then the self-test; then the
  /// commands, so that no command can arm a loop that is not in order. proxy_valid: the proxy was valid in
  /// the previous tick.
  Verdict judge(const DeviceSample& sample, CommandSet commands, const Written& last_write, bool proxy_valid,
                const TickTime& t) noexcept;

  /// The state that authorise() enters if the output stage finds no fault. Changes nothing.
  /// ready: when the wrench was computed.
  State preview(const Demand& demand, const DeviceSample& sample, TimePoint ready,
                const TickTime& t) const noexcept;

  /// Second place: what is wrong with projection, delay and wrench; then one step of ramp or fade. Returns
  /// what may go out.
  Authority authorise(const Demand& demand, const Stabilized& contact, bool overheated,
                      const DeviceSample& sample, TimePoint ready, const TickTime& t) noexcept;

  /// The device is gone, found by a write. The caller must release the hand.
  void lose_device(const TickTime& t) noexcept { raise(Fault::device_lost, t.now); }
  /// The process ends. The caller must release the hand.
  void end() noexcept { machine_.on(Trigger::process_end); }
  /// Forgets the device, after a release: the next one may be another.
  void forget_device() noexcept;

  /// These limits hold from now on, the profile's included.
  void set_limits(const LimitSettings& limits) noexcept;

  State state() const noexcept { return machine_.state(); }
  Fault cause() const noexcept { return machine_.cause(); }
  /// Everything that was raised since the last judge(), this included.
  FaultSet faults() const noexcept { return faults_; }
  /// Fault that changed the state since the last judge(), this included; none if no fault did.
  Fault changed_by() const noexcept { return changed_by_; }

 private:
  bool projection_failed(const Demand& demand) const noexcept;
  bool wrench_late(const Demand& demand, const DeviceSample& sample, TimePoint ready) const noexcept;
  void run_self_test(const DeviceSample& sample, Verdict& verdict, const TickTime& t) noexcept;
  void apply_commands(CommandSet commands, bool proxy_valid, Verdict& verdict, const TickTime& t) noexcept;
  void raise(FaultSet faults, TimePoint now, double value = 0.0) noexcept;
  void raise(Fault fault, TimePoint now, double value = 0.0) noexcept;

  EventQueue& events_;
  bool has_motors_;  ///< The device drives at least one axis.
  Watches watches_;
  SelfTest self_test_;
  StateMachine machine_;
  bool testing_ = false;            ///< The self-test ran in the previous tick.
  int infeasible_ticks_ = 0;        ///< Ticks in a row in which no admissible pose was found.
  FaultSet faults_ = 0;             ///< Faults raised in this tick.
  FaultSet previous_faults_ = 0;    ///< Faults raised in the previous tick.
  Fault changed_by_ = Fault::none;  ///< Fault that changed the state in this tick.
};

}  // namespace wrenchd
