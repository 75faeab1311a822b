// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/cgal/cgal_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "collision/surface_sector.hpp"

namespace wrenchd {
namespace {

using namespace sweep_tolerance;

Triangle face_corners(const MeshSurface& surface, std::uint32_t t) {
  return {surface.corner_m(t, 0), surface.corner_m(t, 1), surface.corner_m(t, 2)};
}

double height_m(const MeshSurface::Plane& plane, const Vector3d& p_m) {
  return plane.normal.dot(p_m) - plane.offset_m;
}

/// f(t) of METHOD (95) at the start, in the middle and at the end, for the lines a + t (a_end - a) and b.
void gap_polynomial(const exact::EdgePair& start, const exact::EdgePair& end, double sign, double (&f)[3]) {
  const Vector3d N_start = start.da.cross(start.db), N_end = end.da.cross(end.db);
  const Vector3d w_start = start.a0 - start.b0, w_end = end.a0 - end.b0;
  f[0] = sign * N_start.dot(w_start);
  f[1] = 0.5 * sign * (N_start.dot(w_end) + N_end.dot(w_start));
  f[2] = sign * N_end.dot(w_end);
}

}  // namespace

CgalContacts::CgalContacts(const Scene& scene) : scene_(scene) {
  if (scene.meshes().empty()) return;
  tool_tree_ = CgalMeshTree::of(scene.tool_mesh()->surface);
  for (const MeshObstacle& obstacle : scene.meshes())
    trees_.push_back(CgalMeshTree::of(obstacle.mesh->surface));
}

void CgalContacts::set_start(const Pose& X_WT, double time_s) noexcept {
  X_start_ = X_WT;
  start_time_s_ = time_s;
}

void CgalContacts::prefetch(const Pose&, const Pose&, VisitBudget&, double, std::uint32_t) noexcept {
  overlap_found_ = false;
}

SweepQuery::SweepResult CgalContacts::sweep(const Pose& X_WT, double clearance_m, VisitBudget&,
                                            double time_s) noexcept {
  SweepResult result;
  clearance_m_ = clearance_m;
  candidate_count_ = 0;
  find_near_obstacles(X_WT, time_s);
  feature_margin_m_ = kBorder * clearance_m + arc_deviation_m_;
  slope_tolerance_ = kSlope;
  test_all_pairs(result);
  if (result.overlaps && crossings_.empty() &&
      displacement_bound_m_ <= kWideBorderPath * scene_.tool_radius_m()) {
    feature_margin_m_ = kWideBorder * displacement_bound_m_;
    slope_tolerance_ = kAnySlope;
    test_all_pairs(result);
  }
  crossings_.select_first(displacement_bound_m_, scene_.tool_radius_m(), result.contacts);
  if (result.contacts.empty() && !result.overlaps &&
      (overlap_found_ || rotation_rad_ > kNegligibleRotation_rad)) {
    result.overlaps = end_pose_overlaps();
    overlap_found_ = overlap_found_ || result.overlaps;
  }
  return result;
}

/// METHOD (92).
double CgalContacts::displacement_bound_m(const Pose& from, const Pose& to) const {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Selects the obstacles whose bounding sphere the tool's may meet, and finds the path relative to each.
void CgalContacts::find_near_obstacles(const Pose& X_WT, double time_s) {
  near_.clear();
  displacement_bound_m_ = displacement_bound_m(X_start_, X_WT);
  rotation_rad_ = X_start_.rotation.angularDistance(X_WT.rotation);
  const Frame start(X_start_), end(X_WT);
  for (std::uint32_t k = 0; k < scene_.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene_.meshes()[k];
    const Pose X_WO_start = obstacle.X_WO_at(start_time_s_), X_WO_end = obstacle.X_WO_at(time_s);
    const Pose X_OT_start = inverse(X_WO_start) * X_start_, X_OT_end = inverse(X_WO_end) * X_WT;
    const double path_m = displacement_bound_m(X_OT_start, X_OT_end);
    const double reach_m = obstacle.radius_m + scene_.tool_radius_m() + 2.0 * path_m + clearance_m_;
    if ((X_OT_start.translation_m - obstacle.centre_O_m).norm() > reach_m) continue;
    ObstacleView view = {&obstacle, scene_.first_mesh() + k, Frame(X_WO_end), {}, {}};
    view.X_OT_start = start.relative_to(Frame(X_WO_start));
    view.X_OT_end = end.relative_to(view.X_WO);
    near_.push_back({view, trees_[k].get()});
    if (!obstacle.moves()) continue;
    displacement_bound_m_ = std::max(displacement_bound_m_, path_m);
    rotation_rad_ = std::max(rotation_rad_, X_OT_start.rotation.angularDistance(X_OT_end.rotation));
  }
  arc_deviation_m_ = 0.25 * rotation_rad_ * rotation_rad_ * scene_.tool_radius_m();
}

void CgalContacts::test_all_pairs(SweepResult& result) {
  touching_.clear();
  crossings_.clear();
  const double margin_m = feature_margin_m_ + arc_deviation_m_ + 2.0 * clearance_m_;
  for (const NearObstacle& near : near_) {
    pairs_.clear();
    near.tree->find_pairs(*tool_tree_, near.view.X_OT_start, near.view.X_OT_end, margin_m, pairs_);
    candidate_count_ += pairs_.size();
    MovedTriangle a = {MeshSurface::kNone, {}, {}, {}, {}};
    for (const CgalMeshTree::Pair& pair : pairs_) {
      if (pair.a != a.triangle) a = moved_triangle(near.view, pair.a);
      test_pair(near.view, a, pair.b, result);
    }
  }
}

bool CgalContacts::end_pose_overlaps() const {
  std::vector<CgalMeshTree::Pair> pairs;
  for (const NearObstacle& near : near_) {
    const Frame& X_OT = near.view.X_OT_end;
    pairs.clear();
    near.tree->find_pairs(*tool_tree_, X_OT, X_OT, clearance_m_, pairs);
    const bool overlaps = std::any_of(pairs.begin(), pairs.end(), [&](const CgalMeshTree::Pair& pair) {
      return exact::triangles_intersect(moved_triangle(near.view, pair.a).end,
                                        face_corners(near.tree->surface(), pair.b));
    });
    if (overlaps) return true;
  }
  return false;
}

CgalContacts::MovedTriangle CgalContacts::moved_triangle(const ObstacleView& view,
                                                         std::uint32_t triangle) const {
  const MeshSurface& tool = tool_tree_->surface();
  const Triangle in_T = face_corners(tool, triangle);
  const MeshSurface::Plane& plane = tool.planes()[triangle];
  const auto plane_in_O = [&](const Frame& X_OT) -> MeshSurface::Plane {
    const Vector3d normal = X_OT.R * plane.normal;
    return {normal, plane.offset_m + normal.dot(X_OT.x_m)};
  };
  MovedTriangle moved = {triangle, {}, {}, plane_in_O(view.X_OT_start), plane_in_O(view.X_OT_end)};
  for (std::size_t i = 0; i < 3; ++i) {
    moved.start[i] = view.X_OT_start * in_T[i];
    moved.end[i] = view.X_OT_end * in_T[i];
  }
  return moved;
}

/// Returns true if a plane keeps a triangle on one side at both ends of the path, and so on the whole path,
/// by at least min_gap_m at the start. Both sides have the same tolerance: on either side of a surface a tool
/// that is held at the clearance touches.
bool CgalContacts::plane_separates(const MeshSurface::Plane& plane_start, const MeshSurface::Plane& plane_end,
                                   const Triangle& start, const Triangle& end, double min_gap_m) const {
  const auto all = [](const Triangle& triangle, const MeshSurface::Plane& plane, double height, int side) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](const Vector3d& p) { return side * exact::side_of_plane(plane, height, p) > 0; });
  };
  const auto none = [](const Triangle& triangle, const MeshSurface::Plane& plane, double height, int side) {
    return std::none_of(triangle.begin(), triangle.end(),
                        [&](const Vector3d& p) { return side * exact::side_of_plane(plane, height, p) > 0; });
  };
  const double apart_m = (1.0 + kClosing) * clearance_m_ + min_gap_m;
  if (all(end, plane_end, apart_m, 1)) return none(start, plane_start, min_gap_m, -1);
  if (all(end, plane_end, -apart_m, -1)) return none(start, plane_start, -min_gap_m, 1);
  return false;
}

/// Tests the features that the two triangles own. If none crosses, tests whether the triangles intersect at
/// the end of the path.
void CgalContacts::test_pair(const ObstacleView& view, const MovedTriangle& a, std::uint32_t b,
                             SweepResult& result) {
  const MeshSurface& tool = tool_tree_->surface();
  const MeshSurface& surface = view.obstacle->mesh->surface;
  const Triangle b_in_O = face_corners(surface, b);
  const MeshSurface::Plane& plane = surface.planes()[b];
  if (plane_separates(plane, plane, a.start, a.end, 0.0)) return;
  // In the tool's frame the obstacle's path deviates from a straight line.
  if (plane_separates(a.plane_start, a.plane_end, b_in_O, b_in_O, arc_deviation_m_)) return;
  const std::size_t before = crossings_.size();
  for (const std::uint32_t vertex : tool.features()[a.triangle].vertices) {
    if (vertex == MeshSurface::kNone) continue;
    const auto pass = vertex_pass(
        surface, b, tool, vertex, [&](const Vector3d& p_T) -> Vector3d { return view.X_OT_start * p_T; },
        [&](const Vector3d& p_T) -> Vector3d { return view.X_OT_end * p_T; });
    if (pass)
      add_contact(pass->closes, pass->path_fraction, view.X_WO * pass->p_m,
                  vertex_face_contact(view, tool, vertex, b, pass->plane));
  }
  for (const std::uint32_t vertex : surface.features()[b].vertices) {
    if (vertex == MeshSurface::kNone) continue;
    const auto pass = vertex_pass(
        tool, a.triangle, surface, vertex,
        [&](const Vector3d& p_O) -> Vector3d { return view.X_OT_start.inverse_transform(p_O); },
        [&](const Vector3d& p_O) -> Vector3d { return view.X_OT_end.inverse_transform(p_O); });
    if (!pass) continue;
    const Contact contact = face_vertex_contact(view, tool, a.triangle, pass->plane, vertex);
    add_contact(pass->closes, pass->path_fraction, contact.p_WCb_m, contact);
  }
  for (const std::uint32_t edge_a : tool.features()[a.triangle].edges)
    for (const std::uint32_t edge_b : surface.features()[b].edges)
      if (edge_a != MeshSurface::kNone && edge_b != MeshSurface::kNone)
        test_edges(view, a, edge_a, edge_b, result);
  if (crossings_.size() == before && !result.overlaps)
    result.overlaps = exact::triangles_intersect(a.end, b_in_O);
}

/// In the frame of the face's body the vertex moves straight, so the gap is a linear function of the path
/// fraction: METHOD (94). at_start, at_end: transform a point of the vertex's body to the frame of the face's
/// body.
template <class AtStart, class AtEnd>
std::optional<CgalContacts::VertexPass> CgalContacts::vertex_pass(
    const MeshSurface& face_body, std::uint32_t triangle, const MeshSurface& vertex_body,
    std::uint32_t vertex, const AtStart& at_start, const AtEnd& at_end) const {
  const MeshSurface::Plane& front = face_body.planes()[triangle];
  const auto pass = vertex_pass_on_side(front, face_body, triangle, vertex_body, vertex, at_start, at_end);
  if (pass || face_body.kind() == MeshSurface::Kind::solid) return pass;
  const MeshSurface::Plane back = {-front.normal, -front.offset_m};
  return vertex_pass_on_side(back, face_body, triangle, vertex_body, vertex, at_start, at_end);
}

/// Tests a vertex against one side of a face. side: plane of the face with the normal towards the vertex.
template <class AtStart, class AtEnd>
std::optional<CgalContacts::VertexPass> CgalContacts::vertex_pass_on_side(
    const MeshSurface::Plane& side, const MeshSurface& face_body, std::uint32_t triangle,
    const MeshSurface& vertex_body, std::uint32_t vertex, const AtStart& at_start,
    const AtEnd& at_end) const {
  const Vector3d& p_body = vertex_body.vertices_m()[vertex];
  const Vector3d p_start = at_start(p_body), p_end = at_end(p_body);
  if (exact::side_of_plane(side, (1.0 + kClosing) * clearance_m_, p_end) > 0) return {};
  if (exact::side_of_plane(side, -kStart * clearance_m_, p_start) < 0) return {};
  VertexPass pass = {side, false, 1.0, p_end};
  pass.closes = exact::side_of_plane(side, (1.0 - kClosing) * clearance_m_, p_end) < 0 &&
                !exact::rises(side.normal, p_end - p_start, kClosing * clearance_m_);
  if (pass.closes)
    pass.path_fraction = closing_time(height_m(side, p_start), height_m(side, p_end), clearance_m_);
  pass.p_m = interpolate(p_start, p_end, pass.path_fraction);
  if (!exact::projects_inside(pass.p_m, face_corners(face_body, triangle),
                              face_body.planes()[triangle].normal,
                              pass.closes ? feature_margin_m_ : kTouch * clearance_m_))
    return {};
  if (face_body.kind() == MeshSurface::Kind::surface && slope_tolerance_ < kAnySlope &&
      is_behind_rim(face_body, triangle, side, pass.p_m, p_start))
    return {};
  const auto ring = vertex_body.ring_of(vertex);
  double rise = 0.0;  // sum of the slopes to the neighbours
  for (const std::uint32_t neighbour : ring) {
    const Vector3d& q_body = vertex_body.vertices_m()[neighbour];
    const Vector3d q = interpolate(at_start(q_body), at_end(q_body), pass.path_fraction);
    const double length_m = (q_body - p_body).norm();
    if (!exact::rises(side.normal, q - pass.p_m, slope_tolerance_ * length_m)) return {};
    rise += side.normal.dot(q - pass.p_m) / length_m;
  }
  // If slopes are ignored, their sum still shows on which side of a surface the body lies.
  const bool behind = rise < -kSlope * static_cast<double>(ring.size());
  if (behind && face_body.kind() == MeshSurface::Kind::surface) return {};
  return pass;
}

/// The gap of two edges times the length of their cross product N is a quadratic function of the path
/// fraction: METHOD (95).
void CgalContacts::test_edges(const ObstacleView& view, const MovedTriangle& a, std::uint32_t edge_a,
                              std::uint32_t edge_b, SweepResult& result) {
  const MeshSurface& tool = tool_tree_->surface();
  const MeshSurface& surface = view.obstacle->mesh->surface;
  const MeshSurface::Edge& ea = tool.convex_edges()[edge_a];
  const MeshSurface::Edge& eb = surface.convex_edges()[edge_b];
  const auto& corners = tool.triangles()[a.triangle];
  const auto i =
      static_cast<std::size_t>(std::find(corners.begin(), corners.end(), ea.vertices[0]) - corners.begin());
  const std::size_t j = (i + 1) % 3;
  const Vector3d& b0 = surface.vertices_m()[eb.vertices[0]];
  const Vector3d db = surface.vertices_m()[eb.vertices[1]] - b0;
  EdgePass pass = {view,
                   edge_a,
                   edge_b,
                   {a.start[i], a.start[j] - a.start[i], b0, db, 1.0},
                   {a.end[i], a.end[j] - a.end[i], b0, db, 1.0},
                   1.0};
  const Vector3d N_start = pass.start.da.cross(db), N_end = pass.end.da.cross(db);
  const double s_start = N_start.norm(), s_end = N_end.norm();
  const double parallel = kParallel * pass.end.da.norm() * db.norm();
  if (!(s_start > parallel) || !(s_end > parallel)) return;
  const OutwardPath out =
      outward_path(surface, eb, tool, ea, view, N_start * exact::compare_gap(pass.start, 0.0));
  pass.sign = exact::rises(out.end, N_end) ? 1.0 : -1.0;
  const bool becomes_parallel = exact::rises(out.start, -pass.sign * N_start);
  pass.start.sign = pass.end.sign = pass.sign;
  double f[3];
  gap_polynomial(pass.start, pass.end, pass.sign, f);
  if (becomes_parallel) {
    result.overlaps = result.overlaps || passes_parallel(pass, f, s_start / (s_start + s_end));
    return;
  }
  if (exact::compare_gap(pass.start, -kStart * clearance_m_) < 0) return;
  const bool open = exact::compare_gap(pass.end, (1.0 + kClosing) * clearance_m_) > 0;
  if (open && f[1] >= 0.0) return;
  const double g[3] = {f[0] - clearance_m_ * s_start, f[1] - 0.5 * clearance_m_ * (s_start + s_end),
                       f[2] - clearance_m_ * s_end};
  const double fraction = std::clamp(first_fall_through_zero(g[0], g[1], g[2]), 0.0, 1.0);
  const bool closes = exact::compare_gap(pass.end, (1.0 - kClosing) * clearance_m_) < 0 &&
                      f[2] / s_end < f[0] / s_start - kClosing * clearance_m_;
  Vector3d point_O_m;
  const bool touch = closes ? edges_touch(pass, pass.sign, fraction, feature_margin_m_, &point_O_m)
                            : !open && edges_touch(pass, pass.sign, 1.0, kTouch * clearance_m_, &point_O_m);
  if (touch) {
    add_contact(closes, fraction, view.X_WO * point_O_m,
                edge_edge_contact(view, tool, edge_a, edge_b, pass.sign, N_end * (pass.sign / s_end)));
    return;
  }
  if (closes) return;
  // The edges separated again. If they overlapped deeply before, the path is too long.
  const double curvature = g[0] - 2.0 * g[1] + g[2];
  const double lowest = curvature > 0.0 ? (g[0] * g[2] - g[1] * g[1]) / curvature : 0.0;
  const double dip_m = std::max(feature_margin_m_, kDip * displacement_bound_m_);
  if (lowest < -dip_m * std::max(s_start, s_end) && edges_touch(pass, pass.sign, fraction, feature_margin_m_))
    result.overlaps = true;
}

/// For edges that become parallel on the path, the outward direction reverses there. Returns true if they
/// cross: the contact would hold the two ends of the path on different sides, so the path is too long.
bool CgalContacts::passes_parallel(const EdgePass& pass, const double (&f)[3],
                                   double parallel_fraction) const {
  const double after = first_fall_through_zero(f[0], f[1], f[2]);
  if (after > parallel_fraction && after <= 1.0 && edges_touch(pass, pass.sign, after, feature_margin_m_))
    return true;
  const double before = first_fall_through_zero(-f[0], -f[1], -f[2]);
  return before < parallel_fraction && before >= 0.0 &&
         edges_touch(pass, -pass.sign, before, feature_margin_m_);
}

/// Returns true if the edges lie opposite each other at this path fraction and all their faces fall away from
/// the plane between them. point_O_m: receives the contact point.
bool CgalContacts::edges_touch(const EdgePass& pass, double sign, double fraction, double tolerance_m,
                               Vector3d* point_O_m) const {
  const MeshSurface& tool = tool_tree_->surface();
  const MeshSurface& surface = pass.view.obstacle->mesh->surface;
  const exact::EdgePair at = {interpolate(pass.start.a0, pass.end.a0, fraction),
                              interpolate(pass.start.da, pass.end.da, fraction), pass.start.b0, pass.start.db,
                              sign};
  if (!exact::edges_opposite(at, tolerance_m)) return false;
  const Vector3d N = at.da.cross(at.db), w = at.b0 - at.a0;
  const double NN = N.squaredNorm();
  if (!(NN > 0.0)) return false;
  const Vector3d p_O_m = at.b0 + (w.cross(at.da).dot(N) / NN) * at.db, n = N * (sign / std::sqrt(NN));
  if (point_O_m != nullptr) *point_O_m = p_O_m;
  if (slope_tolerance_ < kAnySlope) {
    const MeshSurface::Edge &ea = tool.convex_edges()[pass.edge_a], &eb = surface.convex_edges()[pass.edge_b];
    const double x = w.cross(at.db).dot(N) / NN;
    if (surface.kind() == MeshSurface::Kind::surface) {
      const Vector3d a_start = pass.start.a0 + x * pass.start.da;
      if (is_behind_end(surface, eb, p_O_m, p_O_m + clearance_m_ * n, a_start)) return false;
    }
    if (tool.kind() == MeshSurface::Kind::surface) {
      const Vector3d p_T = point_on(tool, ea, x), n_T = pass.view.X_OT_end.R.transpose() * n;
      if (is_behind_end(tool, ea, p_T, p_T - clearance_m_ * n_T,
                        pass.view.X_OT_start.inverse_transform(p_O_m)))
        return false;
    }
  }
  const auto falls_away = [&](const Vector3d& from_edge, double side) {
    return exact::rises(side * n, from_edge, slope_tolerance_ * from_edge.norm());
  };
  for (const std::uint32_t t : surface.convex_edges()[pass.edge_b].triangles)
    for (int k = 0; k < 3 && t != MeshSurface::kNone; ++k)
      if (!falls_away(surface.corner_m(t, k) - at.b0, -1.0)) return false;
  for (const std::uint32_t t : tool.convex_edges()[pass.edge_a].triangles)
    for (int k = 0; k < 3 && t != MeshSurface::kNone; ++k) {
      const Vector3d& p_T = tool.corner_m(t, k);
      if (!falls_away(interpolate(pass.view.X_OT_start * p_T, pass.view.X_OT_end * p_T, fraction) - at.a0,
                      1.0))
        return false;
    }
  return true;
}

/// A contact that does not close on the path touches at its end.
void CgalContacts::add_contact(bool closes, double path_fraction, const Vector3d& point_W_m,
                               const Contact& contact) {
  if (closes)
    crossings_.add(path_fraction, point_W_m, contact);
  else if (!touching_.contains(contact))
    touching_.add(contact);
}

}  // namespace wrenchd
