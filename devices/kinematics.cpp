// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

using std::cos;
using std::sin;

constexpr double kQuarterTurn = std::numbers::pi / 2;

Quaterniond about_x(double angle) noexcept {
  return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitX()));
}
Quaterniond about_y(double angle) noexcept {
  return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitY()));
}
Quaterniond about_z(double angle) noexcept {
  return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ()));
}

/// Tolerance for arguments of acos and sqrt that leave their range through rounding.
constexpr double kRounding = 1e-12;

// --- capstan arm ------------------------------------------------------------------------------------------

Pose arm_forward(const Kinematics& k, const JointAngles& t) noexcept {
  const double a = k.length_m.x(), b = k.length_m.y(), c = k.length_m.z();
  const double r = b * sin(t[1]) + c * sin(t[2]);
  Pose X_DE;
  X_DE.translation_m = Vector3d(r * cos(t[0]), r * sin(t[0]), a + b * cos(t[1]) - c * cos(t[2])) - k.origin_m;
  if (k.joints == kMaxJoints)
    X_DE.rotation =
        about_z(t[0]) * about_y(kQuarterTurn - t[2]) * about_x(t[3]) * about_y(t[4]) * about_x(t[5]);
  return X_DE;
}

/// Wrist: R = Rx(tD) Ry(tE) Rx(tF) with tE in 0 .. pi. If tE = 0, only tD + tF is determined; then tD = 0.
void wrist_inverse(const Matrix3d& R, JointAngles& t) noexcept {
  const double sin_E = std::hypot(R(0, 1), R(0, 2));
  t[4] = std::atan2(sin_E, R(0, 0));
  if (sin_E < kRounding) {
    t[3] = 0.0;
    t[5] = std::atan2(R(2, 1), R(1, 1));
    return;
  }
  t[3] = std::atan2(R(1, 0), -R(2, 0));
  t[5] = std::atan2(R(0, 1), R(0, 2));
}

/// Bodies b and c are a planar arm with two links in the half plane at the angle tA. Height and reach of E
/// relative to the shoulder:  b [cos, sin](tB) + c [cos, sin](pi - tC).
std::optional<JointAngles> arm_inverse(const Kinematics& k, const Pose& X_DE) noexcept {
  const double a = k.length_m.x(), b = k.length_m.y(), c = k.length_m.z();
  const Vector3d p = X_DE.translation_m + k.origin_m;
  const double reach = std::hypot(p.x(), p.y()), height = p.z() - a;
  const double distance = std::hypot(reach, height);
  const double cos_b = (b * b + distance * distance - c * c) / (2.0 * b * distance);
  if (!(std::abs(cos_b) <= 1.0 + kRounding)) return {};
  JointAngles t{};
  t[0] = std::atan2(p.y(), p.x());
  t[1] = std::atan2(reach, height) - std::acos(std::clamp(cos_b, -1.0, 1.0));
  t[2] = std::numbers::pi - std::atan2(reach - b * sin(t[1]), height - b * cos(t[1]));
  if (k.joints == kMaxJoints) {
    const Quaterniond R_forearm = about_z(t[0]) * about_y(kQuarterTurn - t[2]);
    wrist_inverse((R_forearm.conjugate() * X_DE.rotation).toRotationMatrix(), t);
  }
  return t;
}

Matrix3d arm_jacobian(const Kinematics& k, const JointAngles& t) noexcept {
  const double b = k.length_m.y(), c = k.length_m.z();
  const double r = b * sin(t[1]) + c * sin(t[2]);
  Matrix3d J;
  J.col(0) << -r * sin(t[0]), r * cos(t[0]), 0.0;
  J.col(1) << b * cos(t[0]) * cos(t[1]), b * sin(t[0]) * cos(t[1]), -b * sin(t[1]);
  J.col(2) << c * cos(t[0]) * cos(t[2]), c * sin(t[0]) * cos(t[2]), c * sin(t[2]);
  return J;
}

// --- delta ------------------------------------------------------------------------------------------------

/// Position of E in the axes of one leg.
struct Leg {
  double u, v, w;
  double rho;      ///< length of the shin projected onto the plane of u and w
  double drho_dv;  ///< derivative of rho with respect to v
};

std::optional<Leg> leg_at(const Kinematics& k, std::size_t i, const Vector3d& p) noexcept {
  const double cos_phi = cos(k.leg_angle_rad[i]), sin_phi = sin(k.leg_angle_rad[i]);
  Leg leg{};
  leg.u = p.x() * cos_phi + p.y() * sin_phi - k.leg_base_m.x();
  leg.v = p.y() * cos_phi - p.x() * sin_phi - k.leg_base_m.y();
  leg.w = p.z();
  const double lateral = leg.v + k.shin_joint_m.z();
  const double projected2 = k.shin_m * k.shin_m - lateral * lateral;
  if (!(projected2 > 0.0)) return {};
  const double projected = std::sqrt(projected2);
  leg.rho = k.shin_joint_m.y() + projected;
  leg.drho_dv = -lateral / projected;
  return leg;
}

/// Thigh angle t:  U cos t + w sin t = K  with  U = u + c,  K = (U^2 + w^2 + a^2 - rho^2) / (2 a). The
/// smaller of the two solutions has the knee outward, as in the real device.
std::optional<double> thigh_angle(const Kinematics& k, const Leg& leg) noexcept {
  const double a = k.thigh_m;
  const double U = leg.u + k.shin_joint_m.x();
  const double distance = std::hypot(U, leg.w);
  const double cos_delta = (distance * distance + a * a - leg.rho * leg.rho) / (2.0 * a * distance);
  if (!(std::abs(cos_delta) <= 1.0 + kRounding)) return {};
  return std::atan2(leg.w, U) - std::acos(std::clamp(cos_delta, -1.0, 1.0));
}

std::optional<JointAngles> delta_inverse(const Kinematics& k, const Vector3d& p) noexcept {
  JointAngles t{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::optional<Leg> leg = leg_at(k, i, p);
    if (!leg) return {};
    const std::optional<double> angle = thigh_angle(k, *leg);
    if (!angle) return {};
    t[i] = *angle;
  }
  return t;
}

/// Returns dt/dp from the derivative of the constraint between t and p:  g = (U - a cos t)^2 + (w - a sin
/// t)^2 - rho^2.
Matrix3d delta_inverse_jacobian(const Kinematics& k, const JointAngles& t, const Vector3d& p) noexcept {
  const double a = k.thigh_m;
  Matrix3d J = Matrix3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::optional<Leg> leg = leg_at(k, i, p);
    if (!leg) return Matrix3d::Zero();
    const double cos_phi = cos(k.leg_angle_rad[i]), sin_phi = sin(k.leg_angle_rad[i]);
    const double radial = leg->u + k.shin_joint_m.x() - a * cos(t[i]);
    const double vertical = leg->w - a * sin(t[i]);
    const double g_v = -leg->rho * leg->drho_dv;
    const double g_t = a * (radial * sin(t[i]) - vertical * cos(t[i]));
    const auto row = static_cast<Eigen::Index>(i);
    J.row(row) << radial * cos_phi - g_v * sin_phi, radial * sin_phi + g_v * cos_phi, vertical;
    J.row(row) /= -g_t;
  }
  return J;
}

/// Newton's method from the previous position. The handle moves about a millimetre between reports, so two or
/// three steps are enough. A step is halved until it leads to a reachable position with a smaller angle
/// error.
constexpr int kMaxNewtonSteps = 40;
constexpr int kMaxHalvings = 12;
constexpr double kSolvedAngle_rad = 1e-13;
/// Accepted angle error if no step reduces it further. The largest rounding error is that of the acos at a
/// stretched leg.
constexpr double kAcceptedError_rad = 1e-9;
/// Height of the initial guess without a previous position, as a multiple of b: the middle of the Falcon's
/// workspace. A previous position below kLowest is not used: there the legs intersect, and a second solution
/// is near.
constexpr double kInitialHeight = 1.2;
constexpr double kMinHeight = 0.6;

std::optional<Pose> delta_from(const Kinematics& k, const JointAngles& target, Vector3d p) noexcept {
  std::optional<JointAngles> t = delta_inverse(k, p);
  const auto error_of = [&](const JointAngles& angles) {
    return Vector3d(target[0] - angles[0], target[1] - angles[1], target[2] - angles[2]);
  };
  if (!t) return {};
  Vector3d error = error_of(*t);
  for (int iteration = 0; iteration < kMaxNewtonSteps && is_finite(error); ++iteration) {
    if (error.cwiseAbs().maxCoeff() < kSolvedAngle_rad) break;
    Matrix3d J;
    bool invertible = false;
    delta_inverse_jacobian(k, *t, p).computeInverseWithCheck(J, invertible);
    if (!invertible) break;
    Vector3d step = J * error;
    bool improved = false;
    for (int i = 0; i < kMaxHalvings && !improved; ++i, step *= 0.5) {
      const std::optional<JointAngles> next = delta_inverse(k, p + step);
      improved = next && error_of(*next).norm() < error.norm();
      if (!improved) continue;
      p += step;
      t = next;
    }
    if (!improved) break;
    error = error_of(*t);
  }
  if (!is_finite(error) || error.cwiseAbs().maxCoeff() > kAcceptedError_rad) return {};
  return Pose{Quaterniond::Identity(), p};
}

std::optional<Pose> delta_forward(const Kinematics& k, const JointAngles& target, const Pose& near) noexcept {
  std::optional<Pose> found;
  if (near.translation_m.z() > kMinHeight * k.shin_m) found = delta_from(k, target, near.translation_m);
  return found ? found : delta_from(k, target, {0.0, 0.0, kInitialHeight * k.shin_m});
}

}  // namespace

JointAngles joint_angles(const Kinematics& k, const JointCounts& counts) noexcept {
  JointAngles angles{};
  for (std::size_t i = 0; i < k.joints; ++i)
    angles[i] = k.rad_per_count[i] * counts[k.report_index[i]] + k.zero_rad[i];
  return angles;
}

JointCounts joint_counts(const Kinematics& k, const JointAngles& angles) noexcept {
  JointCounts counts{};
  for (std::size_t i = 0; i < k.joints; ++i)
    counts[k.report_index[i]] = (angles[i] - k.zero_rad[i]) / k.rad_per_count[i];
  return counts;
}

JointCounts strip_count_button(const Kinematics& k, JointCounts counts, std::uint32_t& buttons) noexcept {
  const Kinematics::CountButton& button = k.count_button;
  if (!button.present) return counts;
  const std::uint32_t bit = std::uint32_t{1} << button.button;
  buttons &= ~bit;
  if (counts[button.report_index] > button.threshold_counts) {
    counts[button.report_index] -= button.offset_counts;
    buttons |= bit;
  }
  return counts;
}

std::optional<Pose> forward_kinematics(const Kinematics& k, const JointAngles& angles,
                                       const Pose& near) noexcept {
  switch (k.kind) {
    case Kinematics::Kind::none:
      return {};
    case Kinematics::Kind::capstan_arm:
      return arm_forward(k, angles);
    case Kinematics::Kind::delta:
      return delta_forward(k, angles, near);
  }
  return {};
}

std::optional<JointAngles> inverse(const Kinematics& k, const Pose& X_DE) noexcept {
  switch (k.kind) {
    case Kinematics::Kind::none:
      return {};
    case Kinematics::Kind::capstan_arm:
      return arm_inverse(k, X_DE);
    case Kinematics::Kind::delta:
      return delta_inverse(k, X_DE.translation_m);
  }
  return {};
}

Matrix3d jacobian(const Kinematics& k, const JointAngles& angles, const Pose& X_DE) noexcept {
  if (k.kind == Kinematics::Kind::capstan_arm) return arm_jacobian(k, angles);
  Matrix3d J;
  bool invertible = false;
  delta_inverse_jacobian(k, angles, X_DE.translation_m).computeInverseWithCheck(J, invertible);
  return invertible ? J : Matrix3d(Matrix3d::Zero());
}

MotorEfforts motor_efforts(const Kinematics& k, const Matrix3d& J, const Vector3d& force_N) noexcept {
  const Vector3d tau = J.transpose() * force_N;
  MotorEfforts efforts{};
  double max_effort = 0.0;
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    efforts[i] = k.effort_per_Nm[i] * tau[static_cast<Eigen::Index>(i)];
    if (!is_finite(efforts[i])) return {};
    max_effort = std::max(max_effort, std::abs(efforts[i]));
  }
  if (max_effort > k.max_effort)
    for (double& effort : efforts) effort *= k.max_effort / max_effort;
  return efforts;
}

Vector3d joint_torques(const Kinematics& k, const MotorEfforts& efforts) noexcept {
  return {efforts[0] / k.effort_per_Nm[0], efforts[1] / k.effort_per_Nm[1], efforts[2] / k.effort_per_Nm[2]};
}

std::optional<Pose> home_pose(const Kinematics& k) noexcept {
  return forward_kinematics(k, joint_angles(k, k.home_counts), {});
}

}  // namespace wrenchd
