// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/contact_stabilizer.hpp"

#include "core/device_profile.hpp"

namespace wrenchd {
namespace {

/// Factor on the wrench for each oscillation. The third oscillation after arming is a fault, because less
/// stiffness did not help.
constexpr double kOscillationFactor = 0.5;
constexpr int kMaxOscillations = 3;

}  // namespace

ContactStabilizer::ContactStabilizer(const DeviceProfile& profile, const PassivityGuard& guard) noexcept
    : guard_(guard), wrench_about_handle_(profile.wrench_point == WrenchPoint::handle) {}

Stabilized ContactStabilizer::stabilize(const Wrench& requested, const DeviceSample& sample,
                                        const ContactInput& contact) noexcept {
  credit(contact);
  const bool ramp_done = last_state_ == State::ramping && contact.state == State::active;
  last_state_ = contact.state;
  if (!is_driving(contact.state) || contact.state == State::ramping || !wrench_about_handle_) {
    reset_guard(contact.state);
    return {requested, 0, false};
  }
  if (ramp_done) guard_.credit(contact.stored_energy_J);
  Stabilized out;
  double dt_s = 0.0;
  if (contact.sample_usable) {
    if (guard_active_) dt_s = sample.device_time_s - guard_sample_time_s_;
    guard_active_ = true;
    guard_sample_time_s_ = sample.device_time_s;
    out.faults |= detect_oscillation(oscillation_gain_ * requested, sample, dt_s, contact.in_contact);
  }
  out.F = guard_.limit(oscillation_gain_ * requested, sample.X_BH, dt_s, contact.in_contact);
  if (guard_.energy_runaway()) out.faults |= bit(Fault::energy_generated);
  out.intervened = guard_active_ && guard_.intervened();
  return out;
}

/// Work on the springs that the hand did not do is credited, so that the loop may return it.
void ContactStabilizer::credit(const ContactInput& contact) noexcept {
  if (!guard_active_) return;
  guard_.credit(contact.crossfade_work_J);
  guard_.credit_obstacle_work(oscillation_gain_ * contact.obstacle_work_J);
  guard_.credit(contact.local_model_work_J);
}

/// The guard is idle without force and during the ramp. State::waiting follows arming, and restores the full
/// wrench.
void ContactStabilizer::reset_guard(State state) noexcept {
  guard_.reset();
  guard_active_ = false;
  if (state != State::waiting) return;
  oscillation_.reset();
  oscillation_count_ = 0;
  oscillation_gain_ = 1.0;
}

FaultSet ContactStabilizer::detect_oscillation(const Wrench& requested, const DeviceSample& sample,
                                               double dt_s, bool in_contact) noexcept {
  oscillation_.update(requested, sample.V_BH, dt_s, in_contact);
  if (!oscillation_.oscillates()) return 0;
  oscillation_gain_ *= kOscillationFactor;
  oscillation_.reset();
  return bit(++oscillation_count_ < kMaxOscillations ? Fault::oscillating : Fault::oscillation_persists);
}

}  // namespace wrenchd
