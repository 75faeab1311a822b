// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/simulated_handle.hpp"

#include <initializer_list>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"
#include "devices/clamp_norm.hpp"

namespace wrenchd {
namespace {

/// Maximum h^2 K/m of the semi-implicit step. It is stable below 4; below 0.25 a period has at least twelve
/// substeps.
constexpr double kMaxStiffnessNumber = 0.25;

void check(const char* which, double inertia, double stiffness, std::initializer_list<double> others,
           double step_s) {
  const std::string axis = std::string("simulation, handle ") + which + ": ";
  if (!is_finite(inertia) || inertia <= 0.0) throw std::invalid_argument(axis + "inertia must be above 0");
  if (!is_finite(stiffness) || stiffness < 0.0)
    throw std::invalid_argument(axis + "the hand's stiffness must be 0 or more");
  for (const double x : others)
    if (!is_finite(x) || x < 0.0)
      throw std::invalid_argument(axis + "friction, damping and actuator limits must be 0 or more");
  if (step_s * step_s * stiffness / inertia > kMaxStiffnessNumber)
    throw std::invalid_argument(axis + "the hand is too stiff for the inertia at a substep of " +
                                std::to_string(step_s) + " s; lower the stiffness or raise the inertia");
}

/// Scales a vector to a maximum length.
/// Returns the rotation from one orientation to another, as axis times 2 sin(angle/2).
Vector3d chord(const Quaterniond& from, const Quaterniond& to) noexcept {
  const Quaterniond rotation = to * from.conjugate();
  return (rotation.w() < 0.0 ? -2.0 : 2.0) * rotation.vec();
}

/// Rotates R by a small rotation vector in base axes, with Cayley's map: dq ~ [1; phi/2]. The error |phi|^3 /
/// 12 is 4e-11 rad at 12 rad/s and 1/16 ms.
Quaterniond rotated(const Quaterniond& R, const Vector3d& phi) noexcept {
  Quaterniond dq;
  dq.w() = 1.0;
  dq.vec() = 0.5 * phi;
  return (dq * R).normalized();
}

}  // namespace

SimulatedHandle::SimulatedHandle(const SimulationSettings& s, const Pose& X_BH, double step_s)
    : translation_{s.handle_mass_kg,         s.hand_stiffness_N_per_m,
                   s.hand_damping_N_s_per_m, s.viscous_friction_N_s_per_m,
                   s.coulomb_friction_N,     s.actuator_max_force_N},
      rotation_{s.handle_inertia_kg_m2,          s.hand_stiffness_Nm_per_rad, s.hand_damping_Nm_s_per_rad,
                s.viscous_friction_Nm_s_per_rad, s.coulomb_friction_Nm,       s.actuator_max_torque_Nm},
      step_s_(step_s),
      X_BH_(X_BH) {
  for (const auto& [name, motion] :
       {std::pair{"translation", translation_}, std::pair{"rotation", rotation_}})
    check(name, motion.inertia, motion.hand_stiffness,
          {motion.hand_damping, motion.viscous_friction, motion.coulomb_friction, motion.actuator_max},
          step_s);
}

//   (m + h (D + b)) v' = m v + h (F + K offset + D v_G),  then Coulomb friction removes at most h c / (m + h
//   (D + b))
SimulatedHandle::AppliedForces SimulatedHandle::integrate(const MotionParameters& motion,
                                                          const Vector3d& demand, const Vector3d& offset,
                                                          const Vector3d& goal_velocity,
                                                          Vector3d& velocity) noexcept {
  const double h = step_s_;
  const Vector3d motors = clamp_norm(demand, motion.actuator_max);
  const Vector3d spring = motion.hand_stiffness * offset;
  const double inertia = motion.inertia + h * (motion.hand_damping + motion.viscous_friction);
  const Vector3d unbraked =
      (motion.inertia * velocity + h * (motors + spring + motion.hand_damping * goal_velocity)) / inertia;
  const double speed = unbraked.norm();
  const double brake = h * motion.coulomb_friction / inertia;
  velocity = speed > brake ? Vector3d(unbraked * (1.0 - brake / speed)) : Vector3d(Vector3d::Zero());

  const Vector3d hand = spring + motion.hand_damping * (goal_velocity - velocity);
  const double final_speed = velocity.norm();
  energy_.motors_J += h * motors.dot(velocity);
  energy_.hand_J += h * hand.dot(velocity);
  energy_.friction_J += h * final_speed * (motion.viscous_friction * final_speed + motion.coulomb_friction);
  return {motors, hand};
}

void SimulatedHandle::step(const HandTarget& target, const Wrench& F_motors) noexcept {
  const AppliedForces force =
      integrate(translation_, F_motors.force_N, target.X_BG.translation_m - X_BH_.translation_m,
                target.V_BG.linear_m_per_s, V_BH_.linear_m_per_s);
  const AppliedForces torque =
      integrate(rotation_, F_motors.torque_Nm, chord(X_BH_.rotation, target.X_BG.rotation),
                target.V_BG.angular_rad_per_s, V_BH_.angular_rad_per_s);
  F_motors_ = {force.motors, torque.motors};
  F_hand_ = {force.hand, torque.hand};
  X_BH_.translation_m += step_s_ * V_BH_.linear_m_per_s;
  X_BH_.rotation = rotated(X_BH_.rotation, step_s_ * V_BH_.angular_rad_per_s);
}

/// The work of the hand is the change of the kinetic energy, plus the friction loss, minus the work of the
/// motors.
void SimulatedHandle::step_prescribed(const HandTarget& target, const Wrench& F_motors) noexcept {
  const double before_J = kinetic_energy_J();
  const SimulatedEnergy sums = energy_;
  X_BH_ = target.X_BG;
  V_BH_ = target.V_BG;
  F_motors_ = {clamp_norm(F_motors.force_N, translation_.actuator_max),
               clamp_norm(F_motors.torque_Nm, rotation_.actuator_max)};
  F_hand_ = -1.0 * F_motors_;
  const auto rubbed_W = [](const MotionParameters& motion, double speed) {
    return speed * (motion.viscous_friction * speed + motion.coulomb_friction);
  };
  energy_.motors_J += step_s_ * (F_motors_.force_N.dot(V_BH_.linear_m_per_s) +
                                 F_motors_.torque_Nm.dot(V_BH_.angular_rad_per_s));
  energy_.friction_J += step_s_ * (rubbed_W(translation_, V_BH_.linear_m_per_s.norm()) +
                                   rubbed_W(rotation_, V_BH_.angular_rad_per_s.norm()));
  energy_.hand_J += kinetic_energy_J() - before_J + (energy_.friction_J - sums.friction_J) -
                    (energy_.motors_J - sums.motors_J);
}

double SimulatedHandle::kinetic_energy_J() const noexcept {
  return 0.5 * (translation_.inertia * V_BH_.linear_m_per_s.squaredNorm() +
                rotation_.inertia * V_BH_.angular_rad_per_s.squaredNorm());
}

}  // namespace wrenchd
