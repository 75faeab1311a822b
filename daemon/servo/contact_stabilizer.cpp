// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/contact_stabilizer.hpp"

namespace wrenchd {
namespace {

/// Of the device's reports: how long a command may take where nothing says when it arrived.
constexpr double kAssumedPeriods = 2.0;
/// An oscillation costs half of the stiffness; the third is none of the stiffness's.
constexpr double kCalmer = 0.5;
constexpr int kOscillations = 3;

double report_rate_Hz(const Settings& settings, const DeviceProfile& profile) {
  return profile.report_rate_Hz > 0.0 ? profile.report_rate_Hz : settings.servo.rate_Hz;
}

}  // namespace

SteadyContact::SteadyContact(const Settings& settings, const DeviceProfile& profile,
                             const Stability& stability)
    : stability_(stability),
      measured_(kAssumedPeriods / report_rate_Hz(settings, profile)),
      settled_by_(measured_),
      guard_(stability_.guard(measured_)),
      about_handle_(profile.wrench_point == WrenchPoint::handle),
      acknowledges_(profile.pose_report.acknowledged.present) {}

void SteadyContact::measure(const DeviceSample& sample, std::uint64_t commanded, TimePoint now) noexcept {
  measured_.tick({now, sample.arrived, sample.device_time_s, sample.sequence, sample.fresh, acknowledges_,
                  sample.acknowledged, commanded});
}

const StiffnessShare& SteadyContact::settle() noexcept {
  settled_by_ = measured_;
  settled_ = true;
  share_ = bearable(stability_);
  guard_ = stability_.guard(measured_);
  return share_;
}

StiffnessShare SteadyContact::bearable(const Stability& stability) const noexcept {
  return settled_ ? stability.settle(settled_by_, workspace_scale_) : StiffnessShare{};
}

/// The guard knows the device and the delay, and no walls: it stays.
void SteadyContact::change(const Stability& stability) noexcept {
  stability_ = stability;
  share_ = bearable(stability_);
}

bool SteadyContact::take_workspace_scale(double scale) noexcept {
  if (scale == workspace_scale_) return false;
  workspace_scale_ = scale;
  share_ = bearable(stability_);
  return true;
}

Wrench SteadyContact::steadied(const Wrench& asked, const DeviceSample& sample,
                               const Moment& moment) noexcept {
  found_ = 0;
  const bool risen = state_ == State::ramping && moment.state == State::active;
  state_ = moment.state;
  if (!is_driving(state_) || state_ == State::ramping || !about_handle_) {
    rest(state_);
    return asked;
  }
  if (risen) guard_.lend(moment.wound_up_J);
  double dt_s = 0.0;
  if (moment.good) {
    if (guarding_) dt_s = sample.device_time_s - guarded_at_s_;
    guarding_ = true;
    guarded_at_s_ = sample.device_time_s;
    look_for_oscillation(calming_ * asked, sample, dt_s, moment.in_contact);
  }
  const Wrench left = guard_.guard(calming_ * asked, sample.X_BH, dt_s, moment.in_contact);
  if (guard_.out_of_hand()) found_ |= bit(Fault::energy_made);
  return left;
}

/// No force, or one that rises: nothing to guard. Whoever arms anew starts with all of the stiffness.
void SteadyContact::rest(State state) noexcept {
  guard_.reset();
  guarding_ = false;
  if (state != State::waiting) return;
  oscillation_.restart();
  oscillations_ = 0;
  calming_ = 1.0;
}

void SteadyContact::look_for_oscillation(const Wrench& asked, const DeviceSample& sample, double dt_s,
                                         bool in_contact) noexcept {
  oscillation_.update(asked, sample.V_BH, dt_s, in_contact);
  if (!oscillation_.oscillates()) return;
  calming_ *= kCalmer;
  oscillation_.restart();
  found_ |= bit(++oscillations_ < kOscillations ? Fault::oscillating : Fault::still_oscillates);
}

}  // namespace wrenchd
