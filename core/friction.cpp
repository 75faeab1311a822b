// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/friction.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// A contact with at most this gap touches [m]: clearance of the proxy plus rounding.
constexpr double kTouching_m = 1e-8;
/// Squared lever, in radii of gyration, below which a contact resists no rotation: rounding would dominate.
constexpr double kMinSquaredLever = 1e-6;
/// Shorter displacements count as zero [m], and the tool stays bit for bit. No drift results: the next tick
/// measures from the same pose.
constexpr double kMinDisplacement_m = 1e-10;
/// The tool sticks if it would cover no more than this fraction of the path to q*.
constexpr double kMinFraction = 1e-9;
/// Ticks at rest before static friction applies. A slow hand rests between the encoder steps of, for example,
/// 10 um; without this delay static friction would hold it at every step.
constexpr int kTicksToStick = 20;

double displacement_m(const Pose& from, const Pose& to, double lever_m) noexcept {
  return (to.translation_m - from.translation_m).norm() +
         lever_m * from.rotation.angularDistance(to.rotation);
}

/// T = m |s|^2 + theta' H theta for a small rotation theta in T. Returns A with T = m |s|^2 + m |y|^2 for
/// theta = A y.
Matrix3d unit_rotations(const Inertia& M) {
  const Eigen::LLT<Matrix3d> root(M.H_kg_m2 / M.mass_kg);
  return root.matrixU().solve(Matrix3d::Identity());
}

/// Pseudo-inverse of N, a sum of squared contact Jacobians, METHOD (72).
class NormalMatrix {
 public:
  explicit NormalMatrix(const Matrix6d& N) noexcept : eigen_(N) {
    const Vector6d& squares = eigen_.eigenvalues();  // ascending
    for (int i = 0; i < 6; ++i)
      inverse_[i] = squares[i] > kMinSquaredLever * squares[5] ? 1.0 / squares[i] : 0.0;
  }

  bool is_regular() const noexcept { return inverse_[0] > 0.0; }  ///< all six directions are held
  Vector6d solve(const Vector6d& sum) const noexcept {
    return eigen_.eigenvectors() * inverse_.cwiseProduct(eigen_.eigenvectors().transpose() * sum);
  }

 private:
  Eigen::SelfAdjointEigenSolver<Matrix6d> eigen_;
  Vector6d inverse_;
};

}  // namespace

Friction::Friction(const Inertia& M, const FrictionSettings& settings, double clearance_m)
    : M_(M),
      H_inverse_(M.H_kg_m2.inverse()),
      rotation_scale_(unit_rotations(M)),
      settings_(settings),
      projection_(M, ExactProjection::Budget{}, clearance_m) {}

void Friction::reset() noexcept {
  X_WQ_last_.reset();
  sticks_ = false;
  ticks_stuck_ = 0;
}

void Friction::store_contacts(const Projection& answer) noexcept {
  last_contacts_.clear();  // after an iteration limit, `active` may contain contacts that do not touch yet
  for (const ActiveContact& active : answer.active)
    if (gap_m(active.contact, answer.X_WQ) <= kTouching_m) last_contacts_.add(active);
  X_WQ_last_ = answer.X_WQ;
}

Pose Friction::frictional_goal(const Pose& X_WP, const Pose& X_last, bool may_stick) noexcept {
  const int ticks_stuck = std::exchange(ticks_stuck_, 0);
  sticks_ = false;
  if (!X_WQ_last_ || last_contacts_.empty() || !same_bits(*X_WQ_last_, X_last)) return X_WP;
  frictionless_ = projection_.step(X_WP, X_last, std::span(last_contacts_.begin(), last_contacts_.end()), {});
  collect_points(X_last);
  if (std::none_of(points_.begin(), points_.end(), [](const FrictionPoint& t) { return t.multiplier > 0.0; }))
    return X_WP;
  const Pose X_stuck = stick_pose(X_last);
  const double mu =
      ticks_stuck < kTicksToStick ? settings_.dynamic_coefficient : settings_.static_coefficient;
  const double fraction = stick_fraction(mu, X_WP, X_stuck);
  if (fraction <= 0.0) return X_WP;
  if (fraction < 1.0 - kMinFraction) {
    const Pose& X_WQ = frictionless_.X_WQ;
    return goal_for_pose({X_WQ.rotation.slerp(fraction, X_stuck.rotation),
                          X_WQ.translation_m + fraction * (X_stuck.translation_m - X_WQ.translation_m)},
                         fraction);
  }
  ticks_stuck_ = std::min(ticks_stuck + 1, kTicksToStick);
  if (!may_stick || !same_bits(X_stuck, X_last)) return goal_for_pose(X_stuck, 1.0);
  sticks_ = true;
  frictionless_.X_WQ = X_last;
  frictionless_.energy = energy(M_, X_WP, X_last);
  frictionless_.active.clear();
  for (std::size_t i = 0; i < points_.size(); ++i)
    frictionless_.active.add({points_[i].contact, normal_multiplier(i, 1.0)});
  return X_WP;
}

/// Gradient of T with respect to a small rotation of the body in its own axes, E = p^-1 q: 4 (w H v - v x H
/// v).
Vector3d Friction::rotational_gradient(const Quaterniond& E) const noexcept {
  const double sign = E.w() < 0.0 ? -1.0 : 1.0;  // the shorter rotation
  const Vector3d Hv = M_.H_kg_m2 * E.vec();
  return 4.0 * (std::abs(E.w()) * sign * Hv - E.vec().cross(Hv));
}

/// Collects the contacts at q* and the displacement of their points since X_last.
void Friction::collect_points(const Pose& X_last) noexcept {
  points_.clear();
  const Pose& X_WQ = frictionless_.X_WQ;
  const Matrix3d rotation_scale_W = X_WQ.rotation * rotation_scale_;
  for (const ActiveContact& active : frictionless_.active) {
    FrictionPoint point;
    point.contact = active.contact;
    point.multiplier = active.multiplier;
    const Vector3d c_W = contact_point_W(active.contact, X_WQ);
    const Vector3d lever_W = c_W - X_WQ.translation_m;
    point.p_TC_m = X_WQ.rotation.conjugate() * lever_W;
    point.p_WC_m = X_last * point.p_TC_m;
    point.n_W = normal_W(active.contact, X_WQ);
    point.jacobian << Matrix3d::Identity(), -hat(lever_W) * rotation_scale_W;
    point.gap_m = gap_m(active.contact, X_WQ);
    const Vector3d displacement_W = c_W - point.p_WC_m;
    point.slip_W_m = displacement_W - point.n_W * point.n_W.dot(displacement_W);
    points_.add(point);
  }
}

/// Displacement that a pose must undo at one contact: the tangential displacement of the point since X_last,
/// and the change of the gap since q*. A contact without load has no friction; only its gap counts.
Vector3d Friction::stick_error_m(const FrictionPoint& point, const Pose& X_WT) const noexcept {
  const Vector3d& n = point.n_W;
  Vector3d gap_change = n * (gap_m(point.contact, X_WT) - point.gap_m);
  if (point.multiplier <= 0.0) return gap_change;
  const Vector3d displacement = X_WT * point.p_TC_m - point.p_WC_m;
  return displacement - n * n.dot(displacement) + gap_change;
}

/// The stuck pose q_0, METHOD (73): the least displacement from q*, in the metric, that returns the loaded
/// contact points. y is the displacement in units in which M is m times identity: jacobian_i y =
/// stick_error_i, solved for the shortest y. Newton's method with the Jacobians of q*; each step scales the
/// error by the angle rotated.
Pose Friction::stick_pose(const Pose& X_last) const noexcept {
  Matrix6d N = Matrix6d::Zero();
  double longest_m = 0.0;
  for (const FrictionPoint& point : points_) {
    const Vector6d normal = point.jacobian.transpose() * point.n_W;
    if (point.multiplier > 0.0)
      N += point.jacobian.transpose() * point.jacobian;
    else
      N += normal * normal.transpose();
    longest_m = std::max(longest_m, point.p_TC_m.norm());
  }
  const NormalMatrix normal_matrix(N);
  if (normal_matrix.is_regular()) return X_last;
  constexpr int kSteps = 8;
  const Pose& X_WQ = frictionless_.X_WQ;
  Pose X = X_WQ;
  for (int step = 0; step < kSteps; ++step) {
    Vector6d sum = Vector6d::Zero();
    for (const FrictionPoint& point : points_) sum += point.jacobian.transpose() * stick_error_m(point, X);
    const Vector6d y = normal_matrix.solve(sum);
    X.translation_m -= y.head<3>();
    X.rotation =
        (rotation_from(-(X_WQ.rotation * (rotation_scale_ * y.tail<3>()))) * X.rotation).normalized();
    if (y.norm() < 1e-3 * kMinDisplacement_m) break;
  }
  return displacement_m(X_last, X, longest_m) < kMinDisplacement_m ? X_last : X;
}

/// Multiplier of contact i at a fraction of the path from q* to q_0.
double Friction::normal_multiplier(std::size_t i, double fraction) const noexcept {
  return std::max(0.0, points_[i].multiplier + fraction * multiplier_increase_[i]);
}

/// The fraction 1 - s, METHOD (75). Also computes the increase of each multiplier from q* to q_0: at q_0 all
/// contact forces, including friction, balance the pull towards p. Among the solutions it takes the one
/// nearest to the multipliers at q*.
double Friction::stick_fraction(double mu, const Pose& X_WP, const Pose& X_stuck) noexcept {
  Vector6d unbalanced;  // the part of grad T that the multipliers of q* do not balance
  unbalanced << 2.0 * M_.mass_kg * (X_stuck.translation_m - X_WP.translation_m),
      rotation_scale_.transpose() * rotational_gradient(X_WP.rotation.conjugate() * X_stuck.rotation);
  const Matrix3d rotation_scale_W = X_stuck.rotation * rotation_scale_;
  Matrix6d N = Matrix6d::Zero();
  std::array<Vector6d, ContactSet::kCapacity> normal;   // gradients of the gaps
  std::array<Vector6d, ContactSet::kCapacity> sliding;  // gradients of the slip towards q*
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const FrictionPoint& point = points_[i];
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << Matrix3d::Identity(),
        -hat(contact_point_W(point.contact, X_stuck) - X_stuck.translation_m) * rotation_scale_W;
    normal[i] = jacobian.transpose() * normal_W(point.contact, X_stuck);
    sliding[i] = jacobian.transpose() * point.slip_W_m;
    unbalanced -= point.multiplier * normal[i];
    if (point.multiplier > 0.0)
      N += jacobian.transpose() * jacobian;
    else
      N += normal[i] * normal[i].transpose();
  }
  const NormalMatrix normal_matrix(N);
  const Vector6d z = normal_matrix.solve(unbalanced);
  double D = 0.0;
  double D_stuck = 0.0;
  double pull = 0.0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    multiplier_increase_[i] = normal[i].dot(z);
    const FrictionPoint& point = points_[i];
    const double slip_m = point.slip_W_m.norm();
    D += point.multiplier * slip_m;
    D_stuck += (point.multiplier + multiplier_increase_[i]) * slip_m;
    if (point.multiplier > 0.0) pull -= sliding[i].dot(z);
  }
  return mu * D_stuck < pull ? std::min(1.0, mu * D / (pull + mu * (D - D_stuck))) : 1.0;
}

/// The frictional goal p' for q = q_s, METHOD (76): grad T(p', q) = sum lambda_i grad gap_i(q) with the
/// multipliers lambda_i at q_s. In the axes of T at q, with (w, v) the unit quaternion of p'^-1 q,
///
///   2 m R_q' (x_q - x_p') = sum lambda_i R_q' n_i
///   4 (w H v - v x H v)   = sum lambda_i (lever_i x R_q' n_i) = g
///
/// The second equation is solved by the fixed point v = H^-1 (g/4 + v x H v) / w.
Pose Friction::goal_for_pose(const Pose& X_WQ, double fraction) const noexcept {
  Vector3d force = Vector3d::Zero();
  Vector3d torque = Vector3d::Zero();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Contact& contact = points_[i].contact;
    const Vector3d contact_force = normal_multiplier(i, fraction) * normal_W(contact, X_WQ);
    force += contact_force;
    torque += (contact_point_W(contact, X_WQ) - X_WQ.translation_m).cross(contact_force);
  }
  const Vector3d g = X_WQ.rotation.conjugate() * torque;
  // each iteration reduces the error by a factor of about the angle: two digits at 0.1 rad
  constexpr int kSteps = 30;
  // sin(theta/2) for theta = 128 degrees; friction in a real session ends long before
  constexpr double kMaxSine = 0.9;
  Quaterniond E = Quaterniond::Identity();
  for (int step = 0; step < kSteps; ++step) {
    Vector3d v = H_inverse_ * (0.25 * g + E.vec().cross(M_.H_kg_m2 * E.vec())) / E.w();
    if (v.norm() > kMaxSine) v *= kMaxSine / v.norm();
    const double change = (v - E.vec()).norm();
    E.vec() = v;
    E.w() = std::sqrt(1.0 - v.squaredNorm());
    if (change < 1e-15) break;
  }
  return {(X_WQ.rotation * E.conjugate()).normalized(), X_WQ.translation_m - force / (2.0 * M_.mass_kg)};
}

}  // namespace wrenchd
