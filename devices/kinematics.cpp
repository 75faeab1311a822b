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

/// An acos or sqrt argument that rounding may have pushed out of its range by this much still counts.
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

/// The wrist: R = Rx(tD) Ry(tE) Rx(tF), tE taken from 0 to pi. Where tE is 0 only the sum tD + tF is known,
/// and all of it is given to tF.
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

/// Bodies b and c are a planar arm of two links, in the half plane at the angle tA: height and reach of E
/// over the shoulder are  b [cos, sin](tB) + c [cos, sin](pi - tC).
std::optional<JointAngles> arm_inverse(const Kinematics& k, const Pose& X_DE) noexcept {
  const double a = k.length_m.x(), b = k.length_m.y(), c = k.length_m.z();
  const Vector3d p = X_DE.translation_m + k.origin_m;
  const double reach = std::hypot(p.x(), p.y()), height = p.z() - a;
  const double far = std::hypot(reach, height);
  const double cos_b = (b * b + far * far - c * c) / (2.0 * b * far);
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

/// E as one leg sees it.
struct Leg {
  double u, v, w;
  double rho;      ///< length of the shin in the plane of u and w
  double drho_dv;  ///< how it changes along v
};

std::optional<Leg> leg_at(const Kinematics& k, std::size_t i, const Vector3d& p) noexcept {
  const double cos_phi = cos(k.leg_angle_rad[i]), sin_phi = sin(k.leg_angle_rad[i]);
  Leg leg{};
  leg.u = p.x() * cos_phi + p.y() * sin_phi - k.leg_base_m.x();
  leg.v = p.y() * cos_phi - p.x() * sin_phi - k.leg_base_m.y();
  leg.w = p.z();
  const double aside = leg.v + k.shin_joint_m.z();
  const double along2 = k.shin_m * k.shin_m - aside * aside;
  if (!(along2 > 0.0)) return {};
  const double along = std::sqrt(along2);
  leg.rho = k.shin_joint_m.y() + along;
  leg.drho_dv = -aside / along;
  return leg;
}

/// The thigh's angle t:  U cos t + w sin t = K  with  U = u + c,  K = (U^2 + w^2 + a^2 - rho^2) / (2 a).
/// Of the two answers the lower is the knee that points outward, as the device is built.
std::optional<double> thigh_angle(const Kinematics& k, const Leg& leg) noexcept {
  const double a = k.thigh_m;
  const double U = leg.u + k.shin_joint_m.x();
  const double far = std::hypot(U, leg.w);
  const double cos_delta = (far * far + a * a - leg.rho * leg.rho) / (2.0 * a * far);
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

/// dt/dp, from the derivative of the equation that ties t to p:  g = (U - a cos t)^2 + (w - a sin t)^2 -
/// rho^2.
Matrix3d delta_inverse_jacobian(const Kinematics& k, const JointAngles& t, const Vector3d& p) noexcept {
  const double a = k.thigh_m;
  Matrix3d J = Matrix3d::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::optional<Leg> leg = leg_at(k, i, p);
    if (!leg) return Matrix3d::Zero();
    const double cos_phi = cos(k.leg_angle_rad[i]), sin_phi = sin(k.leg_angle_rad[i]);
    const double out = leg->u + k.shin_joint_m.x() - a * cos(t[i]);
    const double up = leg->w - a * sin(t[i]);
    const double g_v = -leg->rho * leg->drho_dv;
    const double g_t = a * (out * sin(t[i]) - up * cos(t[i]));
    const auto row = static_cast<Eigen::Index>(i);
    J.row(row) << out * cos_phi - g_v * sin_phi, out * sin_phi + g_v * cos_phi, up;
    J.row(row) /= -g_t;
  }
  return J;
}

/// Newton's method from the last position: the hand moves a millimetre between reports, so two or three steps
/// do. A step is halved until it leads to a place within reach whose angles are nearer to those wanted.
constexpr int kMostNewtonSteps = 40;
constexpr int kMostHalvings = 12;
constexpr double kAngleTolerance_rad = 1e-13;
/// What may be left where no step leads nearer: rounding, of the acos at a stretched leg at worst.
constexpr double kWorstAngle_rad = 1e-9;
/// Where the search begins when nothing is known: in the middle of the Falcon's workspace, in parts of b. A
/// last position below half of it is none: there the legs fold through each other, and a second answer is
/// near.
constexpr double kMiddle = 1.2;
constexpr double kLowest = 0.6;

std::optional<Pose> delta_from(const Kinematics& k, const JointAngles& wanted, Vector3d p) noexcept {
  std::optional<JointAngles> t = delta_inverse(k, p);
  const auto miss_of = [&](const JointAngles& angles) {
    return Vector3d(wanted[0] - angles[0], wanted[1] - angles[1], wanted[2] - angles[2]);
  };
  if (!t) return {};
  Vector3d miss = miss_of(*t);
  for (int step = 0; step < kMostNewtonSteps && is_finite(miss); ++step) {
    if (miss.cwiseAbs().maxCoeff() < kAngleTolerance_rad) break;
    Matrix3d J;
    bool invertible = false;
    delta_inverse_jacobian(k, *t, p).computeInverseWithCheck(J, invertible);
    if (!invertible) break;
    Vector3d way = J * miss;
    bool nearer = false;
    for (int i = 0; i < kMostHalvings && !nearer; ++i, way *= 0.5) {
      const std::optional<JointAngles> next = delta_inverse(k, p + way);
      nearer = next && miss_of(*next).norm() < miss.norm();
      if (!nearer) continue;
      p += way;
      t = next;
    }
    if (!nearer) break;
    miss = miss_of(*t);
  }
  if (!is_finite(miss) || miss.cwiseAbs().maxCoeff() > kWorstAngle_rad) return {};
  return Pose{Quaterniond::Identity(), p};
}

std::optional<Pose> delta_forward(const Kinematics& k, const JointAngles& wanted, const Pose& near) noexcept {
  std::optional<Pose> found;
  if (near.translation_m.z() > kLowest * k.shin_m) found = delta_from(k, wanted, near.translation_m);
  return found ? found : delta_from(k, wanted, {0.0, 0.0, kMiddle * k.shin_m});
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
  const Kinematics::CountButton& hidden = k.count_button;
  if (!hidden.present) return counts;
  const std::uint32_t bit = std::uint32_t{1} << hidden.button;
  buttons &= ~bit;
  if (counts[hidden.report_index] > hidden.threshold_counts) {
    counts[hidden.report_index] -= hidden.offset_counts;
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
  double most = 0.0;
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    efforts[i] = k.effort_per_Nm[i] * tau[static_cast<Eigen::Index>(i)];
    if (!is_finite(efforts[i])) return {};
    most = std::max(most, std::abs(efforts[i]));
  }
  if (most > k.max_effort)
    for (double& effort : efforts) effort *= k.max_effort / most;
  return efforts;
}

Vector3d joint_torques(const Kinematics& k, const MotorEfforts& efforts) noexcept {
  return {efforts[0] / k.effort_per_Nm[0], efforts[1] / k.effort_per_Nm[1], efforts[2] / k.effort_per_Nm[2]};
}

std::optional<Pose> home_pose(const Kinematics& k) noexcept {
  return forward_kinematics(k, joint_angles(k, k.home_counts), {});
}

}  // namespace wrenchd
