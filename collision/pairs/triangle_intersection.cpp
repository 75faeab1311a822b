// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/triangle_intersection.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

/// Returns true if a plane perpendicular to this axis separates the triangles.
bool apart_along(const Vector3d& axis, const Triangle& p, const Triangle& q) noexcept {
  // Coordinates are relative to one corner, so that a position far from the origin loses no digits.
  const double p1 = axis.dot(p[1] - p[0]), p2 = axis.dot(p[2] - p[0]);
  const double q0 = axis.dot(q[0] - p[0]), q1 = axis.dot(q[1] - p[0]), q2 = axis.dot(q[2] - p[0]);
  return std::min({q0, q1, q2}) > std::max({0.0, p1, p2}) || std::max({q0, q1, q2}) < std::min({0.0, p1, p2});
}

/// Two convex polygons in space are apart if one of these planes separates them: a plane parallel to one of
/// them, a plane parallel to an edge of each, or, for coplanar polygons, a plane that contains an edge and
/// the normal.
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

/// The interval in which a plane cuts a triangle, along the line of intersection.
struct Interval {
  double low, high;
};

/// x: coordinates of the corners along the line. The plane cuts the two sides at the corner that is alone on
/// its side of the plane.
Interval cut(const double (&x)[3], const double (&h)[3]) noexcept {
  const int alone = (h[0] > 0.0) == (h[1] > 0.0) ? 2 : (h[0] > 0.0) == (h[2] > 0.0) ? 1 : 0;
  const int i = alone == 2 ? 0 : alone + 1, j = alone == 0 ? 2 : alone - 1;
  const double a = x[alone] + (x[i] - x[alone]) * h[alone] / (h[alone] - h[i]);
  const double b = x[alone] + (x[j] - x[alone]) * h[alone] / (h[alone] - h[j]);
  return {std::min(a, b), std::max(a, b)};
}

}  // namespace

// Two triangles intersect if each cuts the other's plane and the two cuts overlap on the line of intersection
// of the planes. If rounding leaves in doubt whether a corner lies in the other's plane, or whether the ends
// of the cuts coincide, the test uses all separating axes.
bool triangles_intersect(const Triangle& p, const Triangle& q) noexcept {
  constexpr double kRounding = 1e-9;  // fraction of the largest height, far above rounding
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
