// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/triangle_pair.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Does a plane across this axis pass between the two?
bool apart_along(const Vector3d& axis, const Triangle& p, const Triangle& q) noexcept {
  // From one corner, so that a place far from the origin costs no digits.
  const double p1 = axis.dot(p[1] - p[0]), p2 = axis.dot(p[2] - p[0]);
  const double q0 = axis.dot(q[0] - p[0]), q1 = axis.dot(q[1] - p[0]), q2 = axis.dot(q[2] - p[0]);
  return std::min({q0, q1, q2}) > std::max({0.0, p1, p2}) || std::max({q0, q1, q2}) < std::min({0.0, p1, p2});
}

}  // namespace

// Two convex polygons in space are apart where a plane passes between them that is parallel to one of them,
// to an edge of each, or, where they lie in one plane, upright on an edge of one.
bool triangles_meet(const Triangle& p, const Triangle& q) noexcept {
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

}  // namespace wrenchd
