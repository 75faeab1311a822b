// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/fault.hpp"
#include "core/oscillation.hpp"
#include "daemon/servo/stability_analysis.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Keeps a contact from giving what nobody put into it: measures the loop, takes from that how stiff its
/// walls may be, gives less where the handle buzzes all the same, and guards the energy. RT safe.
class SteadyContact {
 public:
  /// stability: of what is rendered first.
  SteadyContact(const Settings& settings, const DeviceProfile& profile, const Stability& stability);

  // --- the loop as it is, once a tick ---
  void begin_measuring() noexcept { measured_.reset(); }
  /// commanded: number of the last command sent before this tick.
  void measure(const DeviceSample& sample, std::uint64_t commanded, TimePoint now) noexcept;
  /// How stiff the walls may be by what was measured since begin_measuring(); the guard goes by that too.
  const StiffnessShare& settle() noexcept;
  const StiffnessShare& share() const noexcept { return share_; }
  /// How stiff other walls may be, by what was measured when settle() was called last: as stiff as they are
  /// where that was never.
  StiffnessShare bearable(const Stability& stability) const noexcept;
  /// Likewise of springs and brakes about the handle.
  double bearable(const LocalModels::Load& load) const noexcept {
    return stability_.share_at_handle(settled_ ? settled_by_ : measured_, load);
  }
  /// These are the walls from here on.
  void change(const Stability& stability) noexcept;
  /// Metres that the tool goes for a metre of the handle, from here on. Whether that is another than before:
  /// then it bears another share().
  bool take_workspace_scale(double scale) noexcept;

  // --- the contact ---
  struct Moment {
    State state = State::disarmed;
    bool good = false;  ///< the sample is new, and may be used
    bool in_contact = false;
    double wound_up_J = 0.0;  ///< what the spring holds
  };
  /// What may go out of the contact's wrench, about the handle point in B. While the force rises the wall is
  /// wound up around a hand that may be in it, so the guard begins when it has risen, and lends what the
  /// spring holds by then. What holds the handle's weight is none of its business: a hand that lifts it is
  /// given work.
  Wrench steadied(const Wrench& asked, const DeviceSample& sample, const Moment& moment) noexcept;
  /// The spring was wound up from outside by so much, and not by the hand: it may give that back.
  void lend(double energy_J) noexcept {
    if (guarding_) guard_.lend(energy_J);
  }
  /// Obstacles that move wound it up by so much in this tick, or took so much out of it (below 0).
  void push(double energy_J) noexcept {
    if (guarding_) guard_.push(calming_ * energy_J);
  }
  /// What went out of it, after the limits.
  void told(const Wrench& sent) noexcept { guard_.told(sent); }

  /// What steadied() found in this tick.
  FaultSet found() const noexcept { return found_; }
  /// Did the guard change the wrench in this tick?
  bool acted() const noexcept { return guarding_ && guard_.acted(); }
  /// Of the spring that the configuration asks for, with what oscillations have left of it.
  double stiffness_share() const noexcept { return calming_ * share_.spring; }
  const PassivityGuard& guard() const noexcept { return guard_; }

 private:
  void rest(State state) noexcept;
  void look_for_oscillation(const Wrench& asked, const DeviceSample& sample, double dt_s,
                            bool in_contact) noexcept;

  Stability stability_;
  LoopMeasurement measured_;
  LoopMeasurement settled_by_;  ///< what was measured by then
  bool settled_ = false;
  double workspace_scale_ = 1.0;
  PassivityGuard guard_;
  OscillationDetector oscillation_;
  bool about_handle_;  ///< wrenches are about the handle: of others the guard knows nothing
  bool acknowledges_;  ///< the device says which commands it took
  StiffnessShare share_;
  FaultSet found_ = 0;
  State state_ = State::disconnected;  ///< of the last tick
  double calming_ = 1.0;               ///< what oscillations have left, since the loop was armed
  int oscillations_ = 0;               ///< since then
  bool guarding_ = false;
  double guarded_at_s_ = 0.0;  ///< device time of the guard's last sample
};

}  // namespace wrenchd
