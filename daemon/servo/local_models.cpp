// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/local_models.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Of the way to a model that was changed, gone within kFade_s but for 2 %.
constexpr double kFadeLags = 4.0;

double between(double a, double b, double share) noexcept {
  return a + share * (b - a);
}

/// A share of the way from one model to another of the same kind.
void approach(LocalModel& felt, const LocalModel& told, double share) noexcept {
  const Vector3d normal_W = felt.normal_W + share * (told.normal_W - felt.normal_W);
  felt.normal_W = normal_W.norm() > 0.1 ? Vector3d(normal_W.normalized()) : told.normal_W;
  felt.offset_m = between(felt.offset_m, told.offset_m, share);
  felt.X_WA.translation_m += share * (told.X_WA.translation_m - felt.X_WA.translation_m);
  felt.X_WA.rotation = felt.X_WA.rotation.slerp(share, told.X_WA.rotation).normalized();
  felt.stiffness_N_per_m = between(felt.stiffness_N_per_m, told.stiffness_N_per_m, share);
  felt.stiffness_Nm_per_rad = between(felt.stiffness_Nm_per_rad, told.stiffness_Nm_per_rad, share);
  felt.damping_N_s_per_m = between(felt.damping_N_s_per_m, told.damping_N_s_per_m, share);
  felt.damping_Nm_s_per_rad = between(felt.damping_Nm_s_per_rad, told.damping_Nm_s_per_rad, share);
}

/// The spring of a model at this pose, and what it holds.
struct Spring {
  Wrench F;
  double wound_up_J = 0.0;
  bool touches = true;
};

Spring spring_of(const LocalModel& m, const Pose& X_WH) noexcept {
  Spring spring;
  if (m.kind == LocalModel::Kind::plane) {
    const double depth_m = m.offset_m - m.normal_W.dot(X_WH.translation_m);
    spring.touches = depth_m > 0.0;
    if (!spring.touches) return spring;
    spring.F.force_N = m.stiffness_N_per_m * depth_m * m.normal_W;
    spring.wound_up_J = 0.5 * m.stiffness_N_per_m * depth_m * depth_m;
  } else if (m.kind == LocalModel::Kind::spring) {
    const Vector3d way_m = m.X_WA.translation_m - X_WH.translation_m;
    const Vector3d turn_rad = rotation_vector(m.X_WA.rotation * X_WH.rotation.conjugate());
    spring.F = {m.stiffness_N_per_m * way_m, m.stiffness_Nm_per_rad * turn_rad};
    spring.wound_up_J = 0.5 * (spring.F.force_N.dot(way_m) + spring.F.torque_Nm.dot(turn_rad));
  }
  return spring;
}

/// With its brake. A wall brakes along its normal, and does not pull at a hand that leaves it.
Wrench braked(const LocalModel& m, const Spring& spring, const Twist& V_H_W) noexcept {
  if (!spring.touches) return {};
  const Vector3d brake_N = -m.damping_N_s_per_m * V_H_W.linear_m_per_s;
  if (m.kind == LocalModel::Kind::plane)
    return {std::max(spring.F.force_N.dot(m.normal_W) + brake_N.dot(m.normal_W), 0.0) * m.normal_W,
            Vector3d::Zero()};
  return spring.F + Wrench{brake_N, -m.damping_Nm_s_per_rad * V_H_W.angular_rad_per_s};
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
    // One that is not felt, or that is least on its way out.
    const auto least = std::min_element(slots_.begin(), slots_.end(), [](const Slot& a, const Slot& b) {
      return (a.requested ? 2.0 : a.weight) < (b.requested ? 2.0 : b.weight);
    });
    *least = {model, model, 0.0, true};
  }
}

LocalModels::Evaluation LocalModels::evaluate(const Pose& X_WH, const Twist& V_H_W, TimePoint now,
                                              double dt_s, double share) noexcept {
  Evaluation felt;
  const double step = std::max(dt_s, 0.0) / kFade_s;
  for (Slot& slot : slots_) {
    if (!slot.requested && slot.weight <= 0.0) continue;
    if (slot.requested && seconds(slot.target.expires - now) <= slot.weight * kFade_s) slot.requested = false;
    const double before_J = slot.weight * spring_of(slot.current, X_WH).wound_up_J;
    slot.weight = std::clamp(slot.weight + (slot.requested ? step : -step), 0.0, 1.0);
    approach(slot.current, slot.target, std::min(kFadeLags * step, 1.0));
    const Spring spring = spring_of(slot.current, X_WH);
    const double now_J = slot.weight * spring.wound_up_J;
    felt.F_H_W = felt.F_H_W + (share * slot.weight) * braked(slot.current, spring, V_H_W);
    felt.stored_energy_J += share * now_J;
    felt.crossfade_work_J += share * (now_J - before_J);
    felt.any_active = true;
  }
  return felt;
}

LocalModels::TotalGains LocalModels::total_gains() const noexcept {
  TotalGains load;
  for (const Slot& slot : slots_) {
    if (!slot.requested && slot.weight <= 0.0) continue;
    const LocalModel& m = slot.target;
    load.stiffness_N_per_m += m.stiffness_N_per_m;
    load.stiffness_Nm_per_rad += m.stiffness_Nm_per_rad;
    load.damping_N_s_per_m += m.damping_N_s_per_m;
    load.damping_Nm_s_per_rad += m.damping_Nm_s_per_rad;
  }
  return load;
}

void LocalModels::clear() noexcept {
  slots_ = {};
}

}  // namespace wrenchd
