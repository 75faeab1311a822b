// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/free_motion.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace wrenchd {
namespace {

/// Largest rotation of one step of the rotation's integrator [rad], and the largest number of steps.
constexpr double kMaxStep_rad = 0.01;
constexpr int kMaxSteps = 16;

/// Returns (1 - exp(-c t)) / c, which is t for c = 0.
double decayed_time_s(double rate_per_s, double dt_s) noexcept {
  return rate_per_s > 0.0 ? -std::expm1(-rate_per_s * dt_s) / rate_per_s : dt_s;
}

/// Rate of the rotation vector theta of R = R_0 exp(theta^), METHOD (101).
Vector3d rotation_rate(const Matrix3d& H_inverse, const Quaterniond& R_WB, const Vector3d& theta,
                       const Vector3d& spin_W) noexcept {
  const Vector3d omega_B = H_inverse * ((R_WB * rotation_from(theta)).conjugate() * spin_W);
  const Vector3d turned = theta.cross(omega_B);
  return omega_B + 0.5 * turned + theta.cross(turned) / 12.0;
}

/// Rotates for dt_s at constant angular momentum, by the classical Runge-Kutta method on METHOD (101).
Quaterniond rotated(const Matrix3d& H_inverse, const Quaterniond& R_WB, const Vector3d& spin_W,
                    double dt_s) noexcept {
  const Vector3d k1 = rotation_rate(H_inverse, R_WB, Vector3d::Zero(), spin_W);
  const Vector3d k2 = rotation_rate(H_inverse, R_WB, 0.5 * dt_s * k1, spin_W);
  const Vector3d k3 = rotation_rate(H_inverse, R_WB, 0.5 * dt_s * k2, spin_W);
  const Vector3d k4 = rotation_rate(H_inverse, R_WB, dt_s * k3, spin_W);
  return (R_WB * rotation_from(dt_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))).normalized();
}

}  // namespace

Vector3d angular_velocity_W(const Inertia& M, const BodyMotion& motion) noexcept {
  const Quaterniond& R_WB = motion.X_WB.rotation;
  return R_WB * (M.H_kg_m2.inverse() * (R_WB.conjugate() * motion.spin_W));
}

void set_angular_velocity_W(const Inertia& M, const Vector3d& omega_W, BodyMotion& motion) noexcept {
  const Quaterniond& R_WB = motion.X_WB.rotation;
  motion.spin_W = R_WB * (M.H_kg_m2 * (R_WB.conjugate() * omega_W));
}

double kinetic_energy_J(const Inertia& M, const BodyMotion& motion) noexcept {
  return 0.5 * M.mass_kg * motion.velocity_W_m_per_s.squaredNorm() +
         0.5 * motion.spin_W.dot(angular_velocity_W(M, motion));
}

BodyMotion moved_freely(const Inertia& M, const BodyMotion& motion, const FreeForces& forces,
                        double dt_s) noexcept {
  BodyMotion after = motion;
  // v' = g - c v, METHOD (100)
  const double c = forces.linear_damping_per_s;
  const double s = decayed_time_s(c, dt_s);
  const Vector3d& g = forces.gravity_W_m_per_s2;
  after.velocity_W_m_per_s = motion.velocity_W_m_per_s * (1.0 - c * s) + g * s;
  after.X_WB.translation_m += motion.velocity_W_m_per_s * s;
  after.X_WB.translation_m += c > 0.0 ? Vector3d(g * ((dt_s - s) / c)) : Vector3d(g * (0.5 * dt_s * dt_s));
  // Damping shortens the angular momentum and keeps its direction, so the body turns as without damping, for
  // a shorter time.
  const double turning_s = decayed_time_s(forces.angular_damping_per_s, dt_s);
  const Matrix3d H_inverse = M.H_kg_m2.inverse();
  const double angle = (H_inverse * (motion.X_WB.rotation.conjugate() * motion.spin_W)).norm() * turning_s;
  const int steps = static_cast<int>(std::clamp(std::ceil(angle / kMaxStep_rad), 1.0, 1.0 * kMaxSteps));
  for (int k = 0; k < steps; ++k)
    after.X_WB.rotation = rotated(H_inverse, after.X_WB.rotation, motion.spin_W, turning_s / steps);
  after.spin_W = motion.spin_W * (1.0 - forces.angular_damping_per_s * turning_s);
  return after;
}

}  // namespace wrenchd
