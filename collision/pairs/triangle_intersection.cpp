// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/triangle_intersection.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

/// Does a plane across this axis pass between the two?
bool apart_along(const Vector3d& axis, const Triangle& p, const Triangle& q) noexcept {
  // From one corner, so that a place far from the origin costs no digits.
  const double p1 = axis.dot(p[1] - p[0]), p2 = axis.dot(p[2] - p[0]);
  const double q0 = axis.dot(q[0] - p[0]), q1 = axis.dot(q[1] - p[0]), q2 = axis.dot(q[2] - p[0]);
  return std::min({q0, q1, q2}) > std::max({0.0, p1, p2}) || std::max({q0, q1, q2}) < std::min({0.0, p1, p2});
}

/// Two convex polygons in space are apart where a plane passes between them that is parallel to one of them,
/// to an edge of each, or, where they lie in one plane, upright on an edge of one.
bool meet_by_axes(const Triangle& p, const Triangle& q) noexcept {
  const Triangle e = {p[1] - p[0], p[2] - p[1], p[0] - p[2]};
  const Triangle f = {q[1] - q[0], q[2] - q[1], q[0] - q[2]};
  const Vector3d n = e[0].cross(e[1]), m = f[0].cross(f[1]);
  if (apart_along(n, p, q) || apart_along(m, p, q)) return false;
  for (const Vector3d& a : e)
    for (const Vector3d& b : f)
      if (apart_along(a.cross(b), p, q)) return false;
  for (const Vector3d& a : e)
    if (apart_along(n.cross(a), p, q)) return false;
  return std::none_of(f.begin(), f.end(), [&](const Vector3d& b) { return apart_along(m.cross(b), p, q); });
}

/// Heights of the corners of a triangle above a plane through `origin`.
struct Heights {
  double h[3];
  double largest;
};

Heights heights(const Triangle& t, const Vector3d& origin, const Vector3d& normal) noexcept {
  Heights out{{normal.dot(t[0] - origin), normal.dot(t[1] - origin), normal.dot(t[2] - origin)}, 0.0};
  out.largest = std::max({std::abs(out.h[0]), std::abs(out.h[1]), std::abs(out.h[2])});
  return out;
}

/// Where a triangle that a plane cuts meets it, along the line of the cut.
struct Interval {
  double low, high;
};

/// x: the corners' coordinates along the line. The two sides that leave the corner which is alone on its side
/// of the plane are cut where their height is zero.
Interval cut(const double (&x)[3], const double (&h)[3]) noexcept {
  const int alone = (h[0] > 0.0) == (h[1] > 0.0) ? 2 : (h[0] > 0.0) == (h[2] > 0.0) ? 1 : 0;
  const int i = alone == 2 ? 0 : alone + 1, j = alone == 0 ? 2 : alone - 1;
  const double a = x[alone] + (x[i] - x[alone]) * h[alone] / (h[alone] - h[i]);
  const double b = x[alone] + (x[j] - x[alone]) * h[alone] / (h[alone] - h[j]);
  return {std::min(a, b), std::max(a, b)};
}

}  // namespace

// Each triangle must cut the other's plane; both cuts lie on the line where the planes meet, and the
// triangles meet where the cuts overlap. Where a corner lies in the other's plane, as far as rounding can
// tell, or the ends of the cuts coincide, all axes are looked at instead.
bool triangles_intersect(const Triangle& p, const Triangle& q) noexcept {
  constexpr double kRounding = 1e-9;  // of the largest height, far above what rounding can make of it
  const Vector3d m = (q[1] - q[0]).cross(q[2] - q[0]);
  const Heights p_above = heights(p, q[0], m);
  const auto all_one_side = [](const Heights& a) {
    return (a.h[0] > 0.0 && a.h[1] > 0.0 && a.h[2] > 0.0) || (a.h[0] < 0.0 && a.h[1] < 0.0 && a.h[2] < 0.0);
  };
  if (all_one_side(p_above)) return false;
  const Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]);
  const Heights q_above = heights(q, p[0], n);
  if (all_one_side(q_above)) return false;
  const auto doubtful = [](const Heights& a) {
    const double least = kRounding * a.largest;
    return std::abs(a.h[0]) <= least || std::abs(a.h[1]) <= least || std::abs(a.h[2]) <= least;
  };
  if (doubtful(p_above) || doubtful(q_above)) return meet_by_axes(p, q);
  const Vector3d line = n.cross(m);
  int along = 0;
  line.cwiseAbs().maxCoeff(&along);
  const double px[3] = {0.0, p[1][along] - p[0][along], p[2][along] - p[0][along]};
  const double qx[3] = {q[0][along] - p[0][along], q[1][along] - p[0][along], q[2][along] - p[0][along]};
  const Interval a = cut(px, p_above.h), b = cut(qx, q_above.h);
  const double overlap = std::min(a.high, b.high) - std::max(a.low, b.low);
  const double size = std::max({std::abs(a.low), std::abs(a.high), std::abs(b.low), std::abs(b.high)});
  return std::abs(overlap) <= kRounding * size ? meet_by_axes(p, q) : overlap > 0.0;
}

}  // namespace wrenchd
