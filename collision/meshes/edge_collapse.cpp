// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/edge_collapse.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace wrenchd {
namespace {

/// Every face around a collapsed edge must face the mean direction by at least this cosine.
constexpr double kMinFacing = 0.05;
/// Minimum altitude of a new triangle as a fraction of its longest side, unless its predecessors are thinner.
constexpr double kMinAltitude = 1e-5;
/// Because of rounding, a face may lie below the original surface by this.
constexpr double kMaxUndercut_m = 2e-10;
/// A collapse that changes the surface by at most this is exact for contact queries [m].
constexpr double kExact_m = 1e-12;

/// Twice the area of the triangle (origin, a, b) in the x-y plane, positive if anticlockwise [m^2].
double cross_xy(const Vector3d& a, const Vector3d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Returns the height of the plane of the triangle (a, b, c) above x along z [m] if x projects into the
/// triangle or onto its border, nothing otherwise. The triangle is anticlockwise in the x-y plane.
std::optional<double> height_above_m(const Vector3d& x, const Vector3d& a, const Vector3d& b,
                                     const Vector3d& c) {
  const Vector3d to_a = a - x, to_b = b - x, to_c = c - x;
  const double at_a = cross_xy(to_b, to_c), at_b = cross_xy(to_c, to_a), at_c = cross_xy(to_a, to_b);
  const double area = at_a + at_b + at_c, rounding = -1e-12 * area;
  if (!(area > 0.0) || at_a < rounding || at_b < rounding || at_c < rounding) return {};
  return (at_a * to_a.z() + at_b * to_b.z() + at_c * to_c.z()) / area;
}

/// Returns the height of the edge from `a` to `b` above the edge from `c` to `d` along z [m] where they cross
/// in the x-y plane; 0 if they do not cross between their ends.
double height_at_crossing_m(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d ab = b - a, cd = d - c, ac = c - a;
  double area = cross_xy(ab, cd), at_ab = cross_xy(ac, cd), at_cd = cross_xy(ac, ab);
  if (area < 0.0) area = -area, at_ab = -at_ab, at_cd = -at_cd;
  if (!(at_ab > 0.0 && at_ab < area && at_cd > 0.0 && at_cd < area)) return 0.0;
  return (at_ab * ab.z() - at_cd * cd.z()) / area - ac.z();
}

}  // namespace

bool EdgeCollapse::Star::set_mean_normal(const Vector3d& n) {
  cosines.clear();
  ring_N_m.clear();
  for (const Face& face : faces) {
    cosines.add(face.normal.dot(n));
    if (cosines[cosines.size() - 1] < kMinFacing) return false;
  }
  R_NW.row(0) = n.unitOrthogonal();
  R_NW.row(1) = n.cross(R_NW.row(0).transpose());
  R_NW.row(2) = n;
  for (const Vector3d& r_m : ring_m) ring_N_m.add(in_N(r_m));
  u_N_m = in_N(u_m);
  w_N_m = in_N(w_m);
  return true;
}

std::optional<EdgeCollapse::Candidate> EdgeCollapse::find(std::uint32_t half_edge, const Limits& limits) {
  needed_m_ = std::numeric_limits<double>::infinity();
  if (!keeps_manifold(half_edge) || !gather(half_edge)) return {};
  std::optional<Candidate> best;
  const auto try_at = [&](const Vector3d& p_m, NewVertex at) {
    const std::optional<Candidate> candidate = evaluate(p_m, at, limits);
    if (!candidate) return;
    needed_m_ = std::min(needed_m_, candidate->high_m);
    if (candidate->high_m <= limits.wanted_m && (!best || candidate->high_m < best->high_m)) best = candidate;
  };
  const auto is_exact = [&] { return best && best->high_m <= star_.high_m + kExact_m; };
  try_at(star_.u_m, NewVertex::at_u);
  if (is_exact()) return best;
  try_at(star_.w_m, NewVertex::at_w);
  if (is_exact() || limits.max_rise_m < limits.tolerance_m) return best;
  if (const auto p_m = nearest_enclosing_point(limits)) try_at(*p_m, NewVertex::elsewhere);
  return best;
}

/// The link condition: u and w have only the two opposite corners of their faces as common neighbours.
bool EdgeCollapse::keeps_manifold(std::uint32_t h) {
  const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
  if (mesh_.valence(u) + mesh_.valence(w) > kMaxStar) return false;
  for (const std::uint32_t g : {h, mesh_.twin(h)})
    if (mesh_.valence(mesh_.to(HalfEdgeMesh::next(g))) <= 3) return false;
  neighbours_.clear();
  mesh_.for_each_outgoing(u, [&](std::uint32_t g) { neighbours_.add(mesh_.to(g)); });
  int common = 0;
  mesh_.for_each_outgoing(w, [&](std::uint32_t g) {
    if (std::find(neighbours_.begin(), neighbours_.end(), mesh_.to(g)) != neighbours_.end()) ++common;
  });
  if (common != 2) return false;
  return true;
}

/// Collects the star of an edge. Returns false if it cannot be projected onto a plane one to one.
bool EdgeCollapse::gather(std::uint32_t h) {
  star_.faces.clear();
  star_.ring_m.clear();
  star_.u_m = mesh_.vertex_m(mesh_.from(h));
  star_.w_m = mesh_.vertex_m(mesh_.to(h));
  star_.high_m = 0.0;
  star_.low_m = std::numeric_limits<double>::infinity();
  star_.thinnest = 1.0;
  Vector3d normals = Vector3d::Zero();
  const auto add_face = [&](std::uint32_t f) {
    const FaceState& state = faces_[f];
    star_.faces.add({f, state.plane.normal, state.plane.offset_m});
    normals += state.plane.normal;
    star_.high_m = std::max(star_.high_m, state.high_m);
    star_.low_m = std::min(star_.low_m, state.low_m);
    star_.thinnest = std::min(star_.thinnest, state.thinness);
  };
  const std::uint32_t face_0 = HalfEdgeMesh::face_of(h), face_1 = HalfEdgeMesh::face_of(mesh_.twin(h));
  const auto add_corner = [&](std::uint32_t g) {
    const std::uint32_t f = HalfEdgeMesh::face_of(g);
    if (f == face_0 || f == face_1) return;
    star_.ring_m.add(mesh_.vertex_m(mesh_.to(g)));
    add_face(f);
  };
  mesh_.for_each_outgoing_from(h, add_corner);
  star_.w_begin = star_.ring_m.size();
  mesh_.for_each_outgoing_from(mesh_.twin(h), add_corner);
  add_face(face_0);
  add_face(face_1);
  const double length = normals.norm();
  return length > 0.0 && star_.set_mean_normal(normals / length);
}

/// Returns the point nearest to the middle of the edge that lies below no plane of the star.
std::optional<Vector3d> EdgeCollapse::nearest_enclosing_point(const Limits& limits) {
  const Vector3d middle = star_.middle_m();
  problem_.clear();
  for (const Star::Face& face : star_.faces)
    problem_.add_unit(face.normal, face.offset_m - face.normal.dot(middle));
  if (problem_.solve(Vector3d::Zero(), 0.1 * kRounding * limits.size_m) !=
      decltype(problem_)::Status::optimal)
    return {};
  return middle + problem_.z();
}

/// Returns the bounds for the new faces with the merged vertex at p; nothing if p is not allowed, or not in
/// any pass.
std::optional<EdgeCollapse::Candidate> EdgeCollapse::evaluate(const Vector3d& p_m, NewVertex at,
                                                              const Limits& limits) const {
  double lowest_m = 0.0, highest_m = 0.0;
  for (std::size_t i = 0; i < star_.faces.size(); ++i) {
    const Star::Face& face = star_.faces[i];
    const double height_m = face.normal.dot(p_m) - face.offset_m;
    lowest_m = std::min(lowest_m, height_m);
    highest_m = std::max(highest_m, height_m / star_.cosines[i]);
  }
  if (lowest_m < -kRounding * limits.size_m) return {};
  const double low_m = star_.low_m + lowest_m;
  const Vector3d p_N_m = star_.in_N(p_m);
  if (low_m < -kMaxUndercut_m || !new_faces_are_valid(p_N_m)) return {};
  const double most_m = std::min(limits.max_rise_m, limits.tolerance_m - star_.high_m);
  if (highest_m > kExact_m || largest_ring_height_m() > kExact_m) {
    const std::optional<double> rise_m = largest_rise_m(p_N_m, at, most_m);
    highest_m = rise_m ? *rise_m : std::max(highest_m, largest_ring_height_m());
  }
  if (highest_m > most_m) return {};
  return Candidate{p_m, star_.high_m + highest_m, low_m};
}

/// Returns an upper bound for the height of a new face above an old one, if p is not above the old faces.
double EdgeCollapse::largest_ring_height_m() const {
  double highest_m = 0.0;
  for (std::size_t i = 0; i < star_.faces.size(); ++i) {
    const Star::Face& face = star_.faces[i];
    for (const Vector3d& r_m : star_.ring_m)
      highest_m = std::max(highest_m, (face.normal.dot(r_m) - face.offset_m) / star_.cosines[i]);
  }
  return highest_m;
}

/// The new faces project onto the plane of the mean normal without overlap, and none is a needle.
bool EdgeCollapse::new_faces_are_valid(const Vector3d& p_N_m) const {
  const double min_thinness = std::min(kMinAltitude, star_.thinnest);
  for (std::size_t i = 0; i < star_.ring_m.size(); ++i) {
    const Vector3d from = star_.ring_N_m[i] - p_N_m, to = star_.next_on_ring_N_m(i) - p_N_m;
    const Vector3d area = from.cross(to);
    const double area2 = area.squaredNorm();
    if (!(area.z() > 0.0) || !(area.z() * area.z() > kMinFacing * kMinFacing * area2)) return false;
    const double longest2 = std::max({from.squaredNorm(), to.squaredNorm(), (to - from).squaredNorm()});
    const double least = min_thinness * longest2;
    if (area2 < least * least) return false;
  }
  return true;
}

/// Returns the largest height of the new faces above the old ones, along the mean normal; any larger number
/// than most_m if that is exceeded; nothing if rounding hides where p, u or w project. Both surfaces are
/// graphs of piecewise linear functions over the same polygon. So the largest difference occurs at the new
/// vertex, at a removed vertex, or where a new edge crosses an old one: METHOD (97).
std::optional<double> EdgeCollapse::largest_rise_m(const Vector3d& p_N_m, NewVertex at, double most_m) const {
  double rise_m = 0.0;
  if (at == NewVertex::elsewhere) {
    const std::optional<double> at_p_m = height_above_old_faces_m(p_N_m);
    if (!at_p_m) return {};
    rise_m = std::max(rise_m, *at_p_m);
  }
  // The faces at u stay where they are if p is u.
  const std::size_t first = at == NewVertex::at_u ? star_.w_begin : 0;
  const std::size_t last = at == NewVertex::at_w ? star_.w_begin : star_.ring_m.size();
  for (const NewVertex removed : {NewVertex::at_u, NewVertex::at_w}) {
    if (removed == at || rise_m > most_m) continue;
    const std::optional<double> height_m =
        height_of_new_faces_m(p_N_m, removed == NewVertex::at_u ? star_.u_N_m : star_.w_N_m, first, last);
    if (!height_m) return {};
    rise_m = std::max(rise_m, *height_m);
  }
  for (std::size_t i = first; i < last && rise_m <= most_m; ++i) {
    const Vector3d& r = star_.ring_N_m[i];
    const auto cross = [&](const Vector3d& from, const Vector3d& to) {
      rise_m = std::max(rise_m, height_at_crossing_m(p_N_m, r, from, to));
    };
    if (at != NewVertex::at_u)
      for (std::size_t j = 0; j <= star_.w_begin; ++j) cross(star_.u_N_m, star_.ring_N_m[j]);
    if (at != NewVertex::at_w) {
      for (std::size_t j = star_.w_begin; j < star_.ring_m.size(); ++j) cross(star_.w_N_m, star_.ring_N_m[j]);
      cross(star_.w_N_m, star_.ring_N_m[0]);
    }
    if (at == NewVertex::elsewhere) cross(star_.u_N_m, star_.w_N_m);
  }
  return rise_m;
}

/// Returns the height of p above the old face into which it projects [m].
std::optional<double> EdgeCollapse::height_above_old_faces_m(const Vector3d& p_N_m) const {
  std::optional<double> highest_m;
  const auto add = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    if (const auto height_m = height_above_m(p_N_m, a, b, c))
      highest_m = std::max(highest_m.value_or(0.0), -*height_m);
  };
  for (std::size_t i = 0; i < star_.ring_m.size(); ++i)
    add(i < star_.w_begin ? star_.u_N_m : star_.w_N_m, star_.ring_N_m[i], star_.next_on_ring_N_m(i));
  add(star_.u_N_m, star_.w_N_m, star_.ring_N_m[0]);
  add(star_.w_N_m, star_.u_N_m, star_.ring_N_m[star_.w_begin]);
  return highest_m;
}

/// Returns the height above x of the new faces at the corners [first, last) of the ring [m].
std::optional<double> EdgeCollapse::height_of_new_faces_m(const Vector3d& p_N_m, const Vector3d& x_N_m,
                                                          std::size_t first, std::size_t last) const {
  std::optional<double> highest_m;
  for (std::size_t i = first; i < last; ++i)
    if (const auto height_m = height_above_m(x_N_m, p_N_m, star_.ring_N_m[i], star_.next_on_ring_N_m(i)))
      highest_m = std::max(highest_m.value_or(0.0), *height_m);
  return highest_m;
}

}  // namespace wrenchd
