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
  felt.X_WF.translation_m += share * (told.X_WF.translation_m - felt.X_WF.translation_m);
  felt.X_WF.rotation = felt.X_WF.rotation.slerp(share, told.X_WF.rotation).normalized();
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
    const Vector3d way_m = m.X_WF.translation_m - X_WH.translation_m;
    const Vector3d turn_rad = rotation_vector(m.X_WF.rotation * X_WH.rotation.conjugate());
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

void LocalModels::take(const LocalModelSet& models) noexcept {
  for (Slot& slot : slots_) slot.wanted = false;
  for (const LocalModel& model : models) {
    const auto known = std::find_if(slots_.begin(), slots_.end(), [&](const Slot& slot) {
      return slot.weight > 0.0 && slot.model.id == model.id && slot.model.kind == model.kind;
    });
    if (known != slots_.end()) {
      known->model = model;
      known->wanted = true;
      continue;
    }
    // One that is not felt, or that is least on its way out.
    const auto least = std::min_element(slots_.begin(), slots_.end(), [](const Slot& a, const Slot& b) {
      return (a.wanted ? 2.0 : a.weight) < (b.wanted ? 2.0 : b.weight);
    });
    *least = {model, model, 0.0, true};
  }
}

LocalModels::Felt LocalModels::feel(const Pose& X_WH, const Twist& V_H_W, TimePoint now, double dt_s,
                                    double share) noexcept {
  Felt felt;
  const double step = std::max(dt_s, 0.0) / kFade_s;
  for (Slot& slot : slots_) {
    if (!slot.wanted && slot.weight <= 0.0) continue;
    if (slot.wanted && seconds(slot.model.expires - now) <= slot.weight * kFade_s) slot.wanted = false;
    const double before_J = slot.weight * spring_of(slot.felt, X_WH).wound_up_J;
    slot.weight = std::clamp(slot.weight + (slot.wanted ? step : -step), 0.0, 1.0);
    approach(slot.felt, slot.model, std::min(kFadeLags * step, 1.0));
    const Spring spring = spring_of(slot.felt, X_WH);
    const double now_J = slot.weight * spring.wound_up_J;
    felt.F_H_W = felt.F_H_W + (share * slot.weight) * braked(slot.felt, spring, V_H_W);
    felt.wound_up_J += share * now_J;
    felt.given_J += share * (now_J - before_J);
    felt.any = true;
  }
  return felt;
}

LocalModels::Load LocalModels::load() const noexcept {
  Load load;
  for (const Slot& slot : slots_) {
    if (!slot.wanted && slot.weight <= 0.0) continue;
    const LocalModel& m = slot.model;
    load.stiffness_N_per_m += m.stiffness_N_per_m;
    load.stiffness_Nm_per_rad += m.stiffness_Nm_per_rad;
    load.damping_N_s_per_m += m.damping_N_s_per_m;
    load.damping_Nm_s_per_rad += m.damping_Nm_s_per_rad;
  }
  return load;
}

void LocalModels::forget() noexcept {
  slots_ = {};
}

}  // namespace wrenchd
