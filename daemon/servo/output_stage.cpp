// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/output_stage.hpp"

#include "core/finite.hpp"

namespace wrenchd {

OutputStage::OutputStage(const LimitSettings& settings, const DeviceProfile& profile,
                         const PassivityGuard& guard)
    : profile_(profile),
      settings_(settings),
      limits_(settings, profile),
      heat_(profile, limits_.max_force_N(), limits_.max_torque_Nm()),
      stabilizer_(profile, guard) {}

LimitSettings OutputStage::set_limits(const LimitSettings& limits, bool armed) noexcept {
  settings_ = armed ? tighter(settings_, limits, profile_) : limits;
  limits_.set_limits(settings_, profile_);
  heat_.set_maxima(limits_.max_force_N(), limits_.max_torque_Nm());
  return effective_limits();
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

Limited OutputStage::limit(const Stabilized& contact, const Demand& demand, const Authority& authority,
                           const DeviceSample& sample, const TickTime& t) noexcept {
  limits_.set_ceiling(heat_.force_ceiling_N(), heat_.torque_ceiling_Nm());
  if (is_finite(sample.X_BH) && is_finite(sample.V_BH)) {
    p_BH_m_ = sample.X_BH.translation_m;
    V_BH_ = sample.V_BH;
  }
  Limited out = limits_.apply({contact.F + demand.F_weight, authority.scale, t.dt_s, V_BH_, p_BH_m_});
  if (contact.intervened) out.causes |= kPassivity;
  if ((out.causes & kNotFinite) != 0) limits_.reset();
  heat_.advance(out.F, t.dt_s);
  if (authority.send)
    stabilizer_.record_sent(authority.motors_on ? out.F - authority.scale * demand.F_weight : Wrench{});
  return out;
}

}  // namespace wrenchd
