// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/planar_family.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/quartic.hpp"

namespace wrenchd {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A rotation by theta, given by x = tan(theta/2) of Eq. (24); x is infinite for half a turn. Energies are
/// compared without angles, and no term loses digits for small angles.
struct HalfAngleTangent {
  double x;
  double sine;        ///< sin(theta)
  double half_sine2;  ///< sin^2(theta/2)

  explicit HalfAngleTangent(double tan_half) noexcept : x(tan_half) {
    const bool less_than_quarter = std::abs(x) <= 1.0;
    const double t = less_than_quarter ? x : 1.0 / x;
    const double u = 1.0 / (1.0 + t * t);
    sine = 2.0 * t * u;
    half_sine2 = less_than_quarter ? t * t * u : u;
  }
};

/// Eq. (22) with phi = 0; beta - h = -vx sin(theta) - vy cos(theta) - h by Eq. (20).
double energy(const PlanarBody& s, const HalfAngleTangent& turn) noexcept {
  const double lift = 2.0 * s.vy * turn.half_sine2 - s.vx * turn.sine - (s.vy + s.h);
  return s.m * lift * lift + 4.0 * s.H * turn.half_sine2;
}

/// Range of angles of Eq. (21) as x = tan(theta/2), which increases with theta: from min to max, or, if the
/// range contains half a turn, from min to infinity and from minus infinity to max.
struct Range {
  double min = -kInfinity;
  double max = kInfinity;
  bool through_half_turn = false;

  bool contains(double x) const noexcept {
    return through_half_turn ? min <= x || x <= max : min <= x && x <= max;
  }
};

struct BestRotation {
  HalfAngleTangent turn;
  double T;
};

/// Eqs. (31) and (32). Stationary angles are the roots of the quartic Eq. (25) in x with the coefficients of
/// Eqs. (26)-(30) at phi = 0, METHOD (51). vy + h and vy - h are factored out: for a shallow contact vy + h
/// is small and must keep its digits. If A_1 is zero, one root is at x = infinity: half a turn, which is
/// always tried.
BestRotation best_rotation(const PlanarBody& s, const Range& range) noexcept {
  const double sum = s.vy + s.h;
  const double difference = s.vy - s.h;
  const double A1 = s.m * s.vx * difference;
  const double B1 = 2.0 * (s.H + s.m * (s.vy * difference - s.vx * s.vx));
  const double C1 = -6.0 * s.m * s.vx * s.vy;
  const double D1 = 2.0 * (s.H - s.m * (s.vy * sum - s.vx * s.vx));
  const double E1 = s.m * s.vx * sum;

  BestRotation best{HalfAngleTangent(0.0), kInfinity};
  const auto try_turn = [&](double x) noexcept {
    const HalfAngleTangent turn(x);
    const double T = energy(s, turn);
    if (T < best.T) best = {turn, T};
  };
  try_turn(range.min);
  try_turn(range.max);
  if (range.through_half_turn) try_turn(kInfinity);
  for (const double x : real_roots(A1, B1, C1, D1, E1))
    if (range.contains(x)) try_turn(x);
  return best;
}

PlanarMinimum minimum_at(const PlanarBody& s, const BestRotation& best) noexcept {
  const auto& [x, sine, half_sine2] = best.turn;
  const double beta = -s.vx * sine - s.vy * (1.0 - 2.0 * half_sine2);  // Eq. (20)
  return {2.0 * std::atan(x), beta, best.T};                           // Eq. (24)
}

/// A direction in the section: x along e1, y along the obstacle normal; any length.
struct Direction2 {
  double x;
  double y;
  double length() const noexcept { return std::sqrt(x * x + y * y); }
};

/// Range of angles, METHOD (52), from the directions a and b of the section's edges; the body lies between
/// them. alpha is the angle of the first edge from the x-axis, alpha + gamma that of the second, 0 <= gamma <
/// pi. Both edges stay above the obstacle for
///
///   -alpha <= theta <= pi - (alpha + gamma)
///
/// which is Eq. (21) for alpha = 0.
Range range_of(Direction2 a, Direction2 b) noexcept {
  if (a.x * b.y < a.y * b.x) std::swap(a, b);
  const double tan_a = a.x >= 0.0 ? a.y / (a.length() + a.x) : (a.length() - a.x) / a.y;  // tan(alpha/2)
  const double cot_b = b.x >= 0.0 ? (b.length() + b.x) / b.y : b.y / (b.length() - b.x);
  return {-tan_a, cot_b, std::signbit(a.y) && b.y < 0.0};
}

}  // namespace

PlanarMinimum minimise(const PlanarSection& s) noexcept {
  using std::numbers::pi;
  const Range range{std::tan(0.5 * s.theta_min), std::tan(0.5 * s.theta_max), s.theta_max > pi};
  const BestRotation best = best_rotation(s, range);
  PlanarMinimum minimum = minimum_at(s, best);
  if (range.through_half_turn && best.turn.x <= range.max) minimum.theta += 2.0 * pi;
  minimum.theta = std::clamp(minimum.theta, s.theta_min, s.theta_max);
  return minimum;
}

PlanarFamily::PlanarFamily(const Inertia& M, const ConvexBody& body, int planes) : M_(M), body_(body) {
  const int count = std::max(planes, 1);
  for (int k = 0; k < count; ++k) {
    const double delta = std::numbers::pi * k / count;
    directions_.push_back({std::sin(delta), std::cos(delta)});
  }
}

PlanarFamily::AtContact::AtContact(const PlanarFamily& family, const Pose& X_WP,
                                   const Contact& contact) noexcept
    : family_(family), ring_(family.body_.ring_of(contact.tool_feature)), apex_T_(contact.p_TCa_m) {
  const Vector3d& n = contact.n_W;
  const Vector3d reference = std::abs(n.z()) < 0.9 ? Vector3d::UnitZ() : Vector3d::UnitX();
  Z_W_ = (reference - reference.dot(n) * n).normalized();
  X_W_ = n.cross(Z_W_);
  const Matrix3d R_PW = X_WP.rotation.conjugate().toRotationMatrix();
  X_T_ = R_PW * X_W_;
  n_T_ = R_PW * n;
  Z_T_ = R_PW * Z_W_;
  v_X_ = X_T_.dot(apex_T_);
  v_n_ = n_T_.dot(apex_T_);
  v_Z_ = Z_T_.dot(apex_T_);
  const Matrix3d& H = family.M_.H_kg_m2;
  H_XX_ = X_T_.dot(H * X_T_);
  H_XZ_ = X_T_.dot(H * Z_T_);
  H_ZZ_ = Z_T_.dot(H * Z_T_);
  h_ = n.dot(X_WP.translation_m) - contact.offset_m;
}

PlanarFamily::InPlane PlanarFamily::AtContact::solve(int k) const noexcept {
  // METHOD (53): the axis w_delta of Eq. (34) by sine and cosine, and e1 = n x w. The section's axes are (e1,
  // n, w).
  const auto [sine, cosine] = family_.directions_[static_cast<std::size_t>(k)];
  const Vector3d w_T = sine * X_T_ + cosine * Z_T_;
  const Vector3d e1_T = cosine * X_T_ - sine * Z_T_;
  PlanarBody section;
  section.m = family_.M_.mass_kg;
  section.H = sine * sine * H_XX_ + 2.0 * sine * cosine * H_XZ_ + cosine * cosine * H_ZZ_;
  section.vx = cosine * v_X_ - sine * v_Z_;
  section.vy = v_n_;
  section.h = h_;

  // Paper, Algorithm 2, for any number of faces at the vertex: the plane cuts the faces in two directions. A
  // face edge in the plane is such a direction. If the plane meets the body in the vertex only, the angle is
  // not limited.
  const auto& vertices = family_.body_.vertices_T_m;
  std::array<Direction2, 2> cut;
  std::size_t cuts = 0;
  const auto add = [&](const Vector3d& p_T) noexcept { cut[cuts++] = {e1_T.dot(p_T), n_T_.dot(p_T)}; };
  Vector3d previous = vertices[ring_.back()] - apex_T_;
  double d_previous = w_T.dot(previous);
  for (std::size_t i = 0; i < ring_.size() && cuts < 2; ++i) {
    const Vector3d edge = vertices[ring_[i]] - apex_T_;
    const double d = w_T.dot(edge);
    if (d == 0.0) {
      add(edge);  // paper, Algorithm 2, lines 1-8: the plane contains an edge
    } else if (d * d_previous < 0.0) {
      // paper, Algorithm 2, lines 10-15, without normalization
      add(std::abs(d_previous) * edge + std::abs(d) * previous);
    }
    previous = edge;
    d_previous = d;
  }
  const Range range = cuts < 2 ? Range{} : range_of(cut[0], cut[1]);
  return {minimum_at(section, best_rotation(section, range)), sine * X_W_ + cosine * Z_W_};
}

Pose PlanarFamily::pose(const Pose& X_WP, const Contact& contact, const InPlane& solution) noexcept {
  const double h = contact.n_W.dot(X_WP.translation_m) - contact.offset_m;
  const Quaterniond turn(Eigen::AngleAxisd(solution.minimum.theta, solution.axis_W));
  return {(turn * X_WP.rotation).normalized(),
          X_WP.translation_m + (solution.minimum.beta - h) * contact.n_W};
}

}  // namespace wrenchd
