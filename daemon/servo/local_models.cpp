// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/local_models.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Number of time constants in kFade_s. After kFade_s, 2 % of a parameter change is left.
constexpr double kTimeConstantsPerFade = 4.0;

double interpolate(double a, double b, double fraction) noexcept {
  return a + fraction * (b - a);
}

/// Moves the parameters of `current` by `fraction` of the difference to `target`, a model of the same kind.
void approach(LocalModel& current, const LocalModel& target, double fraction) noexcept {
  const Vector3d normal_W = current.normal_W + fraction * (target.normal_W - current.normal_W);
  current.normal_W = normal_W.norm() > 0.1 ? Vector3d(normal_W.normalized()) : target.normal_W;
  current.offset_m = interpolate(current.offset_m, target.offset_m, fraction);
  current.X_WA.translation_m += fraction * (target.X_WA.translation_m - current.X_WA.translation_m);
  current.X_WA.rotation = current.X_WA.rotation.slerp(fraction, target.X_WA.rotation).normalized();
  current.stiffness_N_per_m = interpolate(current.stiffness_N_per_m, target.stiffness_N_per_m, fraction);
  current.stiffness_Nm_per_rad =
      interpolate(current.stiffness_Nm_per_rad, target.stiffness_Nm_per_rad, fraction);
  current.damping_N_s_per_m = interpolate(current.damping_N_s_per_m, target.damping_N_s_per_m, fraction);
  current.damping_Nm_s_per_rad =
      interpolate(current.damping_Nm_s_per_rad, target.damping_Nm_s_per_rad, fraction);
}

/// Elastic part of a model at one handle pose.
struct Spring {
  Wrench F;
  double stored_energy_J = 0.0;
  bool in_contact = true;
};

Spring spring_at(const LocalModel& m, const Pose& X_WH) noexcept {
  Spring spring;
  if (m.kind == LocalModel::Kind::plane) {
    const double depth_m = m.offset_m - m.normal_W.dot(X_WH.translation_m);
    spring.in_contact = depth_m > 0.0;
    if (!spring.in_contact) return spring;
    spring.F.force_N = m.stiffness_N_per_m * depth_m * m.normal_W;
    spring.stored_energy_J = 0.5 * m.stiffness_N_per_m * depth_m * depth_m;
  } else if (m.kind == LocalModel::Kind::spring) {
    const Vector3d displacement_m = m.X_WA.translation_m - X_WH.translation_m;
    const Vector3d rotation_rad = rotation_vector(m.X_WA.rotation * X_WH.rotation.conjugate());
    spring.F = {m.stiffness_N_per_m * displacement_m, m.stiffness_Nm_per_rad * rotation_rad};
    spring.stored_energy_J =
        0.5 * (spring.F.force_N.dot(displacement_m) + spring.F.torque_Nm.dot(rotation_rad));
  }
  return spring;
}

/// Returns spring plus damper. A plane damps along its normal only, and never pulls the handle towards
/// itself.
Wrench damped(const LocalModel& m, const Spring& spring, const Twist& V_H_W) noexcept {
  if (!spring.in_contact) return {};
  const Vector3d damping_N = -m.damping_N_s_per_m * V_H_W.linear_m_per_s;
  if (m.kind == LocalModel::Kind::plane)
    return {std::max(spring.F.force_N.dot(m.normal_W) + damping_N.dot(m.normal_W), 0.0) * m.normal_W,
            Vector3d::Zero()};
  return spring.F + Wrench{damping_N, -m.damping_Nm_s_per_rad * V_H_W.angular_rad_per_s};
}

}  // namespace

void LocalModels::set_models(const LocalModelSet& models) noexcept {
  for (Slot& slot : slots_) slot.requested = false;
  for (const LocalModel& model : models) {
    const auto known = std::find_if(slots_.begin(), slots_.end(), [&](const Slot& slot) {
      return slot.weight > 0.0 && slot.target.id == model.id && slot.target.kind == model.kind;
    });
    if (known != slots_.end()) {
      known->target = model;
      known->requested = true;
      continue;
    }
    // A free slot has weight 0. If no slot is free, the one that faded out furthest is reused.
    const auto least = std::min_element(slots_.begin(), slots_.end(), [](const Slot& a, const Slot& b) {
      return (a.requested ? 2.0 : a.weight) < (b.requested ? 2.0 : b.weight);
    });
    *least = {model, model, 0.0, true};
  }
}

LocalModels::Evaluation LocalModels::evaluate(const Pose& X_WH, const Twist& V_H_W, TimePoint now,
                                              double dt_s, double scale) noexcept {
  Evaluation sum;
  const double step = std::max(dt_s, 0.0) / kFade_s;
  for (Slot& slot : slots_) {
    if (!slot.requested && slot.weight <= 0.0) continue;
    if (slot.requested && seconds(slot.target.expires - now) <= slot.weight * kFade_s) slot.requested = false;
    const double before_J = slot.weight * spring_at(slot.current, X_WH).stored_energy_J;
    slot.weight = std::clamp(slot.weight + (slot.requested ? step : -step), 0.0, 1.0);
    approach(slot.current, slot.target, std::min(kTimeConstantsPerFade * step, 1.0));
    const Spring spring = spring_at(slot.current, X_WH);
    const double after_J = slot.weight * spring.stored_energy_J;
    sum.F_H_W = sum.F_H_W + (scale * slot.weight) * damped(slot.current, spring, V_H_W);
    sum.stored_energy_J += scale * after_J;
    sum.crossfade_work_J += scale * (after_J - before_J);
    sum.any_active = true;
  }
  return sum;
}

LocalModels::TotalGains LocalModels::total_gains() const noexcept {
  TotalGains total;
  for (const Slot& slot : slots_) {
    if (!slot.requested && slot.weight <= 0.0) continue;
    const LocalModel& m = slot.target;
    total.stiffness_N_per_m += m.stiffness_N_per_m;
    total.stiffness_Nm_per_rad += m.stiffness_Nm_per_rad;
    total.damping_N_s_per_m += m.damping_N_s_per_m;
    total.damping_Nm_s_per_rad += m.damping_Nm_s_per_rad;
  }
  return total;
}

void LocalModels::clear() noexcept {
  slots_ = {};
}

}  // namespace wrenchd
