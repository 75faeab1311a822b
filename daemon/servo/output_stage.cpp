// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/output_stage.hpp"

#include <algorithm>
#include <utility>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Ratio of the sent force to the requested one, or of the torques if that is less, 0 to 1. Without a
/// request, returns `otherwise`.
double share_of(const Wrench& sent, const Wrench& requested, double otherwise) noexcept {
  double share = 1.0;
  bool any = false;
  const auto include = [&](const Vector3d& part, const Vector3d& whole) {
    if (!(whole.squaredNorm() > 0.0)) return;
    any = true;
    share = std::min(share, part.norm() / whole.norm());
  };
  include(sent.force_N, requested.force_N);
  include(sent.torque_Nm, requested.torque_Nm);
  return any ? share : std::clamp(otherwise, 0.0, 1.0);
}

bool is_same(const Wrench& a, const Wrench& b) noexcept {
  return a.force_N == b.force_N && a.torque_Nm == b.torque_Nm;
}

}  // namespace

OutputStage::OutputStage(const LimitSettings& settings, const DeviceProfile& profile,
                         const EnergyBounds& bounds)
    : profile_(profile),
      settings_(settings),
      limits_(settings, profile),
      heat_(profile, limits_.max_force_N(), limits_.max_torque_Nm()),
      stabilizer_(profile, bounds.guard),
      account_(bounds.account) {}

LimitSettings OutputStage::set_limits(const LimitSettings& limits, bool armed) noexcept {
  settings_ = armed ? tighter(settings_, limits, profile_) : limits;
  limits_.set_limits(settings_, profile_);
  heat_.set_maxima(limits_.max_force_N(), limits_.max_torque_Nm());
  return effective_limits();
}

void OutputStage::reset() noexcept {
  limits_.reset();
  account_.reset();
  F_external_sent_ = Wrench{};
}

LimitSettings OutputStage::effective_limits() const noexcept {
  LimitSettings effective = settings_;
  effective.max_force_N = limits_.max_force_N();
  effective.max_torque_Nm = limits_.max_torque_Nm();
  return effective;
}

Stabilized OutputStage::stabilize(const Demand& demand, const DeviceSample& sample, State state) noexcept {
  if (demand.proxy_invalidated) limits_.reset();
  return stabilizer_.stabilize(demand.F_contact, sample,
                               {state, demand.sample_usable, demand.in_contact, demand.stored_energy_J,
                                demand.crossfade_work_J, demand.obstacle_work_J, demand.local_model_work_J});
}

/// Returns the part of the external wrench that the account allows. Without a usable sample no work is
/// taken from the account: the next sample shows the work since the last one.
Wrench OutputStage::permitted_external(const Demand& demand, const DeviceSample& sample,
                                       const TickTime& t) noexcept {
  account_.deposit(demand.external_declared_J);
  if (!demand.external_active) account_.close();
  double dt_s = 0.0;
  if (demand.sample_usable)
    dt_s = sample.device_time_s - std::exchange(external_sample_time_s_, sample.device_time_s);
  return account_.permit(demand.F_external, sample.X_BH, dt_s, t.dt_s);
}

Limited OutputStage::limit(const Stabilized& contact, const Demand& demand, const Authority& authority,
                           const DeviceSample& sample, const TickTime& t) noexcept {
  limits_.set_ceiling(heat_.force_ceiling_N(), heat_.torque_ceiling_Nm());
  if (is_finite(sample.X_BH) && is_finite(sample.V_BH)) {
    p_BH_m_ = sample.X_BH.translation_m;
    V_BH_ = sample.V_BH;
  }
  const Wrench F_external = permitted_external(demand, sample, t);
  const Wrench F_own = contact.F + demand.F_weight;
  const Wrench requested = demand.external_active ? F_own + F_external : F_own;
  Limited out = limits_.apply({requested, authority.scale, t.dt_s, V_BH_, p_BH_m_});
  if (contact.intervened || !is_same(F_external, demand.F_external)) out.causes |= kPassivity;
  if ((out.causes & kNotFinite) != 0) limits_.reset();
  heat_.advance(out.F, t.dt_s);
  const bool motors_on = authority.send && authority.motors_on;
  F_external_sent_ = Wrench{};
  if (motors_on && demand.external_active)
    F_external_sent_ = is_same(F_own, {}) ? out.F : share_of(out.F, requested, 0.0) * F_external;
  account_.record_sent(F_external_sent_);
  Wrench F_contact = out.F - authority.scale * demand.F_weight;
  if (demand.external_active) F_contact = F_contact - F_external_sent_;
  contact_share_ = motors_on ? share_of(F_contact, demand.F_contact, authority.scale) : 0.0;
  if (authority.send) stabilizer_.record_sent(authority.motors_on ? F_contact : Wrench{});
  return out;
}

}  // namespace wrenchd
