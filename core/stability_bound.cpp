// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/stability_bound.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <Eigen/Eigenvalues>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Rounding error of an eigenvalue relative to the largest one. A larger negative eigenvalue is
/// rejected.
constexpr double kRounding = 1e-9;

[[noreturn]] void reject(const std::string& what) {
  throw std::invalid_argument("stability bound: " + what);
}

bool finite(const Matrix6d& K) noexcept {
  return std::all_of(K.data(), K.data() + K.size(), [](double x) { return is_finite(x); });
}

void check_damping(double b, DofMask driven, const char* key) {
  if (driven == kNoDof) return;
  if (!is_finite(b) || b < 0.0)
    reject(std::string("the device profile must state ") + key +
           ", 0 or more; measure it with the motors off, or state 0 and nothing can be rendered");
}

void check(const DeviceDamping& device, const LoopDelay& loop, const Coupling& coupling, DofMask driven,
           const EncoderStep& step) {
  check_damping(device.linear_N_s_per_m, driven & kLinearDofs, "damping_N_s_per_m");
  check_damping(device.angular_Nm_s_per_rad, driven & kAngularDofs, "damping_Nm_s_per_rad");
  if (!is_finite(loop.period_s) || loop.period_s <= 0.0) reject("the loop's period must be above 0 s");
  if (!is_finite(loop.delay_s) || loop.delay_s < 0.0) reject("the loop's delay must be 0 s or more");
  for (const double s : {step.linear_m, step.angular_rad})
    if (!is_finite(s) || s < 0.0) reject("an encoder's step must be 0 or more");
  for (const auto& [name, K] :
       {std::pair{"stiffness", &coupling.stiffness}, {"damping", &coupling.damping}}) {
    if (!finite(*K)) reject(std::string("the ") + name + " has a number that is not finite");
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(0.5 * (*K + K->transpose()), Eigen::EigenvaluesOnly);
    if (eigen.eigenvalues()[0] < -kRounding * std::abs(eigen.eigenvalues()[5]))
      reject(std::string("the ") + name +
             " pushes apart in some direction; its symmetric part must have no " + "negative eigenvalue");
  }
}

/// Sets all rows and columns of degrees of freedom that are not driven to 0.
Matrix6d driven_block(Matrix6d K, DofMask driven) noexcept {
  for (int i = 0; i < 6; ++i)
    if ((driven >> i & 1) == 0) {
      K.row(i).setZero();
      K.col(i).setZero();
    }
  return K;
}

Vector6d diagonal(const DeviceDamping& device, DofMask driven) noexcept {
  Vector6d b;
  for (int i = 0; i < 6; ++i)
    b[i] = (driven >> i & 1) == 0 ? 1.0 : i < 3 ? device.linear_N_s_per_m : device.angular_Nm_s_per_rad;
  return b;
}

/// The largest s with s L <= B for a diagonal B and a positive semidefinite L: one over the
/// largest eigenvalue of B^-1/2 L B^-1/2. Infinite if L is 0. 0 if B has a zero where L is positive.
double largest_scale(const Matrix6d& L, const Vector6d& B) {
  Vector6d root = Vector6d::Zero();
  for (int i = 0; i < 6; ++i) {
    if (B[i] > 0.0)
      root[i] = 1.0 / std::sqrt(B[i]);
    else if (L(i, i) > 0.0)
      return 0.0;
  }
  const Matrix6d scaled = root.asDiagonal() * L * root.asDiagonal();
  const double most =
      Eigen::SelfAdjointEigenSolver<Matrix6d>(scaled, Eigen::EigenvaluesOnly).eigenvalues()[5];
  return most > 0.0 ? 1.0 / most : std::numeric_limits<double>::infinity();
}

/// The largest k with k L + D <= B, by bisection with largest_scale().
double largest_beside_damper(const Matrix6d& L, const Matrix6d& D, const Vector6d& B) {
  if (largest_scale(D, B) < 1.0) return 0.0;
  double most = largest_scale(L, B);
  if (!(most < std::numeric_limits<double>::infinity()) || D.isZero(0.0)) return most;
  double least = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double k = 0.5 * (least + most);
    (largest_scale(k * L + D, B) >= 1.0 ? least : most) = k;
  }
  return least;
}

/// The largest s with s S K S <= 4 kMaxEnergyPerEncoderStep_J I, METHOD (82).
double largest_by_steps(const Matrix6d& K, const EncoderStep& step) {
  Vector6d S;
  S << Vector3d::Constant(step.linear_m), Vector3d::Constant(step.angular_rad);
  return largest_scale(S.asDiagonal() * K * S.asDiagonal(),
                       Vector6d::Constant(4.0 * kMaxEnergyPerEncoderStep_J));
}

}  // namespace

Matrix6d energy_stiffness(const Inertia& M, double k_per_s2) noexcept {
  Matrix6d K = Matrix6d::Zero();
  K.topLeftCorner<3, 3>() = k_per_s2 * M.mass_kg * Matrix3d::Identity();
  K.bottomRightCorner<3, 3>() = k_per_s2 * M.H_kg_m2;
  return K;
}

// METHOD (79). V_T = Ad V_H with Ad of X_TH, so F_H = Ad' F_T and K_H = Ad' K_T Ad.
Matrix6d transform_to_handle(const Matrix6d& K_T, const Pose& X_HT) noexcept {
  const Matrix6d Ad = adjoint(inverse(X_HT));
  return Ad.transpose() * (0.5 * (K_T + K_T.transpose())) * Ad;
}

// METHOD (78), (82)
//
//   s ( (T/2 + tau) K_H + D_H ) <= diag(b I, b_rot I)         s S K_H S <= 4 kMaxEnergyPerEncoderStep_J I
StabilityBound stability_bound(const DeviceDamping& device, const LoopDelay& loop, const Coupling& coupling,
                               const Pose& X_HT, DofMask driven, const EncoderStep& step) {
  check(device, loop, coupling, driven, step);
  const double lag_s = 0.5 * loop.period_s + loop.delay_s;
  const auto at_handle_driven = [&](const Matrix6d& K_T) {
    return driven_block(transform_to_handle(K_T, X_HT), driven);
  };
  const auto unit_stiffness = [&](int first) {
    Matrix6d K = Matrix6d::Zero();
    K.diagonal().segment<3>(first).setOnes();
    return K;
  };
  const Vector6d B = diagonal(device, driven);
  const Matrix6d K = at_handle_driven(coupling.stiffness), D = at_handle_driven(coupling.damping);
  const double by_steps = std::min(1.0, largest_by_steps(K, step));
  const auto largest_stiffness = [&](const Matrix6d& K_one) {
    return std::min(largest_beside_damper(lag_s * K_one, D, B), largest_by_steps(K_one, step));
  };
  StabilityBound out;
  out.scale = std::min(by_steps, largest_scale(lag_s * K + D, B));
  out.scale_undamped = std::min(by_steps, largest_scale(lag_s * K, B));
  out.max_stiffness_N_per_m = largest_stiffness(at_handle_driven(unit_stiffness(0)));
  out.max_stiffness_Nm_per_rad = largest_stiffness(at_handle_driven(unit_stiffness(3)));
  return out;
}

}  // namespace wrenchd
