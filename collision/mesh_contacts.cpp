// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/mesh_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "collision/surface_sector.hpp"

namespace wrenchd {
namespace {

/// Cost of one pair: kVisitsPerPair if it reaches the feature tests, 1 / kPairsPerVisit if the separating
/// axes decide it.
constexpr std::uint32_t kVisitsPerPair = 1;
constexpr std::size_t kPairsPerVisit = 2;

/// Returns true if the projection of p on the triangle's plane lies inside the triangle, or at most beyond_m
/// outside.
bool projects_inside(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c,
                     const Vector3d& normal, double tolerance_m) noexcept {
  const auto within = [&](const Vector3d& from, const Vector3d& to) {
    const Vector3d along = to - from;
    const double outside = along.cross(normal).dot(p - from);
    return outside <= 0.0 || outside * outside <= tolerance_m * tolerance_m * along.squaredNorm();
  };
  return within(a, b) && within(b, c) && within(c, a);
}

}  // namespace

MeshContacts::MeshContacts(const Scene& scene, bool motion_is_continuous)
    : scene_(scene), candidates_(scene, motion_is_continuous) {
  remaining_pairs_.resize(BvhTraversal::kCapacity);
  for (std::uint32_t k = 0; k < scene.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene.meshes()[k];
    obstacle_views_.push_back({&obstacle, scene.first_mesh() + k, Frame(obstacle.X_WO), {}, {}});
  }
  if (scene.tool_mesh() != nullptr && scene.tool_mesh()->surface.kind() == MeshSurface::Kind::surface)
    tool_sides_ = MeshSurface::kBothSides;
}

void MeshContacts::set_start(const Pose& X_WT, double time_s) noexcept {
  continue_from(X_WT, time_s);
  X_start_ = X_WT;
  start_time_s_ = time_s;
}

/// Tells the candidate lists if this pose is neither the start nor the end of a path on which the tool met
/// nothing.
void MeshContacts::continue_from(const Pose& X_WT, double time_s) noexcept {
  const bool at_start = same_bits(X_WT, X_start_) && time_s == start_time_s_;
  const bool at_end = same_bits(X_WT, X_free_end_) && time_s == free_end_time_s_;
  if (!at_start && !at_end) candidates_.tool_was_placed();
}

void MeshContacts::prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s,
                            std::uint32_t spare_visits) noexcept {
  continue_from(X_WT, time_s);
  candidates_.prefetch(X_WT, X_WP, budget, time_s, spare_visits);
  overlap_found_ = false;
  sweep_visits_ = 0;
}

MeshContacts::SweepResult MeshContacts::sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget,
                                              double time_s) noexcept {
  SweepResult result;
  touching_.clear();
  clearance_m_ = clearance_m;
  if (!candidates_.ensure_covers(X_start_, X_WT, {start_time_s_, time_s}, budget)) {
    result.complete = false;
    result.list_pending = candidates_.list_pending();
    return result;
  }
  update_obstacle_views(X_WT, time_s);
  feature_margin_m_ = sweep_tolerance::kBorder * clearance_m + arc_deviation_m_;
  slope_tolerance_ = sweep_tolerance::kSlope;
  test_pairs(budget, result);
  if (result.overlaps && crossings_.empty() &&
      displacement_bound_m_ <= sweep_tolerance::kWideBorderPath * scene_.tool_radius_m()) {
    feature_margin_m_ = sweep_tolerance::kWideBorder * displacement_bound_m_;
    slope_tolerance_ = sweep_tolerance::kAnySlope;
    test_pairs(budget, result);
  }
  crossings_.select_first(displacement_bound_m_, scene_.tool_radius_m(), result.contacts);
  if (result.contacts.empty() && !result.overlaps &&
      (overlap_found_ || rotation_rad_ > sweep_tolerance::kNegligibleRotation_rad))
    verify_end_pose(budget, result);
  if (result.contacts.empty() && !result.overlaps && result.complete) {
    X_free_end_ = X_WT;
    free_end_time_s_ = time_s;
  }
  return result;
}

/// Tests the end pose for intersecting triangles. After an overlap all later sweeps of the tick test their
/// end poses too.
void MeshContacts::verify_end_pose(VisitBudget& budget, SweepResult& result) noexcept {
  const MeshBvh& tool = *scene_.tool_mesh();
  for (const std::uint32_t k : candidates_.current().nearby_obstacles()) {
    const MeshSurface& surface = obstacle_views_[k].obstacle->mesh->surface;
    const Frame& X_OT = obstacle_views_[k].X_OT_end;
    const Pose pose = {Quaterniond(X_OT.R), X_OT.x_m};
    result.complete = traversal_.find(tool.bvh, obstacle_views_[k].obstacle->mesh->bvh, {pose, pose}, budget);
    if (!result.complete) return;
    result.overlaps = std::any_of(traversal_.begin(), traversal_.end(), [&](const TrianglePair& pair) {
      return triangles_intersect(
          {X_OT * tool.surface.corner_m(pair.a, 0), X_OT * tool.surface.corner_m(pair.a, 1),
           X_OT * tool.surface.corner_m(pair.a, 2)},
          {surface.corner_m(pair.b, 0), surface.corner_m(pair.b, 1), surface.corner_m(pair.b, 2)});
    });
    overlap_found_ = overlap_found_ || result.overlaps;
    if (result.overlaps) return;
  }
}

/// Updates the paths relative to all nearby obstacles.
void MeshContacts::update_obstacle_views(const Pose& X_WT, double time_s) noexcept {
  const Frame start(X_start_), end(X_WT);
  displacement_bound_m_ = candidates_.current().displacement_bound_m(X_start_, X_WT);
  rotation_rad_ = X_start_.rotation.angularDistance(X_WT.rotation);
  for (const std::uint32_t k : candidates_.current().nearby_obstacles()) {
    ObstacleView& view = obstacle_views_[k];
    view.sides = candidates_.sides_of(k);
    if (!view.obstacle->moves()) {
      view.X_OT_start = start.relative_to(view.X_WO);
      view.X_OT_end = end.relative_to(view.X_WO);
      continue;
    }
    const Pose X_WO_start = view.obstacle->X_WO_at(start_time_s_), X_WO_end = view.obstacle->X_WO_at(time_s);
    const Pose X_OT_start = inverse(X_WO_start) * X_start_, X_OT_end = inverse(X_WO_end) * X_WT;
    view.X_WO = Frame(X_WO_end);
    view.X_OT_start = start.relative_to(Frame(X_WO_start));
    view.X_OT_end = end.relative_to(view.X_WO);
    displacement_bound_m_ =
        std::max(displacement_bound_m_, candidates_.current().displacement_bound_m(X_OT_start, X_OT_end));
    rotation_rad_ = std::max(rotation_rad_, X_OT_start.rotation.angularDistance(X_OT_end.rotation));
  }
  // The path of a vertex is straight if nothing rotates: METHOD (95a).
  arc_deviation_m_ = 0.25 * rotation_rad_ * rotation_rad_ * scene_.tool_radius_m();
}

/// Runs the culler first, because a plane of one of the two triangles separates most pairs on the whole path.
void MeshContacts::test_pairs(VisitBudget& budget, SweepResult& result) noexcept {
  touching_.clear();
  crossings_.clear();
  moved_triangle_.triangle = MeshSurface::kNone;
  PairCuller& culler = candidates_.culler();
  const double tool_m = scene_.tool_mesh()->bvh.extent_m();
  for (std::size_t k = 0; k < culler.groups().size(); ++k) {
    const ObstacleView& view = obstacle_views_[culler.groups()[k].obstacle];
    const PairCuller::CullResult culled =
        culler.cull(k, view.X_OT_start, view.X_OT_end, tool_m + view.obstacle->mesh->bvh.extent_m(),
                    feature_margin_m_ + arc_deviation_m_ + 2.0 * clearance_m_, remaining_pairs_.data());
    const auto cull_work =
        static_cast<std::uint32_t>(culled.tested / PredictiveCandidateList::kPairsPerVisit);
    tested_pairs_ = 0;
    for (const std::uint32_t i : std::span(remaining_pairs_).first(culled.remaining)) {
      const CandidatePair& pair = candidates_.current().pairs()[i];
      test_pair(pair, moved_triangle(pair), result);
    }
    const auto test_work =
        static_cast<std::uint32_t>(culled.remaining / kPairsPerVisit) + kVisitsPerPair * tested_pairs_;
    budget.remaining -= std::min(budget.remaining, cull_work + test_work);
    sweep_visits_ += cull_work + test_work;
  }
}

const MeshContacts::MovedTriangle& MeshContacts::moved_triangle(const CandidatePair& pair) noexcept {
  if (moved_triangle_.triangle == pair.a && moved_triangle_.obstacle == pair.obstacle) return moved_triangle_;
  const ObstacleView& view = obstacle_views_[pair.obstacle];
  moved_triangle_.triangle = pair.a;
  moved_triangle_.obstacle = pair.obstacle;
  for (int i = 0; i < 3; ++i) {
    const Vector3d& p_T = scene_.tool_mesh()->surface.corner_m(pair.a, i);
    const auto k = static_cast<std::size_t>(i);
    moved_triangle_.start[k] = view.X_OT_start * p_T;
    moved_triangle_.end[k] = view.X_OT_end * p_T;
  }
  const MeshSurface::Plane& plane = scene_.tool_mesh()->surface.planes()[pair.a];
  const auto plane_in_O = [&](const Frame& X_OT) -> MeshSurface::Plane {
    const Vector3d normal = X_OT.R * plane.normal;
    return {normal, plane.offset_m + normal.dot(X_OT.x_m)};
  };
  moved_triangle_.plane_start = plane_in_O(view.X_OT_start);
  moved_triangle_.plane_end = plane_in_O(view.X_OT_end);
  return moved_triangle_;
}

/// A gap that is below the clearance at the start closes if the path narrows it further.
bool MeshContacts::closes(double start_m, double end_m) const noexcept {
  return end_m < (1.0 - sweep_tolerance::kClosing) * clearance_m_ &&
         end_m < start_m - sweep_tolerance::kClosing * clearance_m_;
}

/// Returns true if a plane keeps a triangle on one side at both ends of the path, and so on the whole path,
/// by at least min_gap_m at the start. Both sides have the same tolerance: on either side of a surface a tool
/// that is held at the clearance touches.
bool MeshContacts::plane_separates(const Heights& start_m, const Heights& end_m,
                                   double min_gap_m) const noexcept {
  const double apart_m = (1.0 + sweep_tolerance::kClosing) * clearance_m_ + min_gap_m;
  if (std::min({end_m[0], end_m[1], end_m[2]}) > apart_m)
    return std::min({start_m[0], start_m[1], start_m[2]}) >= min_gap_m;
  if (std::max({end_m[0], end_m[1], end_m[2]}) < -apart_m)
    return std::max({start_m[0], start_m[1], start_m[2]}) <= -min_gap_m;
  return false;
}

void MeshContacts::test_pair(const CandidatePair& pair, const MovedTriangle& a,
                             SweepResult& result) noexcept {
  const ObstacleView& view = obstacle_views_[pair.obstacle];
  const MeshSurface& surface = view.obstacle->mesh->surface;
  const Triangle b = {surface.corner_m(pair.b, 0), surface.corner_m(pair.b, 1), surface.corner_m(pair.b, 2)};
  if (separating_axes_.separated(a.start, a.end, b,
                                 feature_margin_m_ + arc_deviation_m_ + 2.0 * clearance_m_))
    return;
  const MeshSurface::Plane& plane = surface.planes()[pair.b];
  const auto heights = [](const MeshSurface::Plane& plane_above, const Triangle& triangle) -> Heights {
    return {plane_above.normal.dot(triangle[0]) - plane_above.offset_m,
            plane_above.normal.dot(triangle[1]) - plane_above.offset_m,
            plane_above.normal.dot(triangle[2]) - plane_above.offset_m};
  };
  const Heights a_end = heights(plane, a.end);
  if (plane_separates(heights(plane, a.start), a_end, 0.0)) return;
  // In the tool's frame the obstacle's path deviates from a straight line.
  if (plane_separates(heights(a.plane_start, b), heights(a.plane_end, b), arc_deviation_m_)) return;
  ++tested_pairs_;
  const std::size_t before = crossings_.size();
  vertices_on_face(view, pair);
  face_on_vertices(view, pair);
  edges_on_edges(view, pair, a, result);
  if (crossings_.size() > before || result.overlaps) return;
  if (std::min({a_end[0], a_end[1], a_end[2]}) > 0.0 || std::max({a_end[0], a_end[1], a_end[2]}) < 0.0)
    return;
  result.overlaps = triangles_intersect(a.end, b);
}

/// Both features of the pair are in the frame of the face's body, in which the vertex moves straight. So the
/// gap is a linear function of the path fraction: METHOD (94). at_start, at_end: transform a point of the
/// vertex's body to the frame of the face's body at both ends of the path. sides: those of the face's body on
/// which the vertex can be.
template <class AtStart, class AtEnd>
std::optional<MeshContacts::VertexPass> MeshContacts::vertex_pass(
    const MeshSurface& face_body, unsigned sides, std::uint32_t triangle, const MeshSurface& vertex_body,
    std::uint32_t vertex, const AtStart& at_start, const AtEnd& at_end) const noexcept {
  const MeshSurface::Plane& front = face_body.planes()[triangle];
  std::optional<VertexPass> pass;
  if ((sides & MeshSurface::kFront) != 0)
    pass = vertex_pass_on_side(front, sides, face_body, triangle, vertex_body, vertex, at_start, at_end);
  if (pass || (sides & MeshSurface::kBack) == 0) return pass;
  const MeshSurface::Plane back = {-front.normal, -front.offset_m};
  return vertex_pass_on_side(back, sides, face_body, triangle, vertex_body, vertex, at_start, at_end);
}

/// Tests a vertex against one side of a face. side: plane of the face with the normal towards the vertex.
template <class AtStart, class AtEnd>
std::optional<MeshContacts::VertexPass> MeshContacts::vertex_pass_on_side(
    const MeshSurface::Plane& side, unsigned sides, const MeshSurface& face_body, std::uint32_t triangle,
    const MeshSurface& vertex_body, std::uint32_t vertex, const AtStart& at_start,
    const AtEnd& at_end) const noexcept {
  const Vector3d& p_body = vertex_body.vertices_m()[vertex];
  const Vector3d p_end = at_end(p_body);
  const double end_m = side.normal.dot(p_end) - side.offset_m;
  if (end_m > (1.0 + sweep_tolerance::kClosing) * clearance_m_) return {};
  const Vector3d p_start = at_start(p_body);
  const double start_m = side.normal.dot(p_start) - side.offset_m;
  if (start_m < -sweep_tolerance::kStart * clearance_m_) return {};
  VertexPass pass;
  pass.plane = side;
  pass.closes = closes(start_m, end_m);
  pass.path_fraction = pass.closes ? closing_time(start_m, end_m, clearance_m_) : 1.0;
  pass.p = interpolate(p_start, p_end, pass.path_fraction);
  if (!projects_inside(pass.p, face_body.corner_m(triangle, 0), face_body.corner_m(triangle, 1),
                       face_body.corner_m(triangle, 2), face_body.planes()[triangle].normal,
                       pass.closes ? feature_margin_m_ : sweep_tolerance::kTouch * clearance_m_))
    return {};
  if (sides == MeshSurface::kBothSides && slope_tolerance_ < sweep_tolerance::kAnySlope &&
      is_behind_rim(face_body, triangle, side, pass.p, p_start))
    return {};
  const auto ring = vertex_body.ring_of(vertex);
  double rise = 0.0;  // sum of the slopes to the neighbours
  for (const std::uint32_t neighbour : ring) {
    const Vector3d& q_body = vertex_body.vertices_m()[neighbour];
    const Vector3d q = interpolate(at_start(q_body), at_end(q_body), pass.path_fraction);
    const double length_m = (q_body - p_body).norm(), height_m = side.normal.dot(q - pass.p);
    if (!(height_m >= -slope_tolerance_ * length_m)) return {};
    rise += height_m / length_m;
  }
  // If slopes are ignored, their sum still shows on which side of a surface the body lies.
  const bool behind = rise < -sweep_tolerance::kSlope * static_cast<double>(ring.size());
  if (behind && sides == MeshSurface::kBothSides) return {};
  return pass;
}

/// Tests the vertices that the tool's triangle owns against the obstacle's triangle.
void MeshContacts::vertices_on_face(const ObstacleView& view, const CandidatePair& pair) noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = view.obstacle->mesh->surface;
  for (const std::uint32_t vertex : tool.features()[pair.a].vertices) {
    if (vertex == MeshSurface::kNone) continue;
    const auto pass = vertex_pass(
        surface, view.sides, pair.b, tool, vertex,
        [&](const Vector3d& p_T) -> Vector3d { return view.X_OT_start * p_T; },
        [&](const Vector3d& p_T) -> Vector3d { return view.X_OT_end * p_T; });
    if (!pass) continue;
    const Contact contact = vertex_face_contact(view, tool, vertex, pair.b, pass->plane);
    add_contact(pass->closes, pass->path_fraction, view.X_WO * pass->p, contact);
  }
}

/// Tests the vertices that the obstacle's triangle owns against the tool's triangle.
void MeshContacts::face_on_vertices(const ObstacleView& view, const CandidatePair& pair) noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = view.obstacle->mesh->surface;
  for (const std::uint32_t vertex : surface.features()[pair.b].vertices) {
    if (vertex == MeshSurface::kNone || (surface.sides_of_vertex(vertex) & view.sides) == 0) continue;
    const auto pass = vertex_pass(
        tool, tool_sides_, pair.a, surface, vertex,
        [&](const Vector3d& p_O) -> Vector3d { return view.X_OT_start.inverse_transform(p_O); },
        [&](const Vector3d& p_O) -> Vector3d { return view.X_OT_end.inverse_transform(p_O); });
    if (!pass) continue;
    const Contact contact = face_vertex_contact(view, tool, pair.a, pass->plane, vertex);
    add_contact(pass->closes, pass->path_fraction, contact.p_WCb_m, contact);
  }
}

void MeshContacts::edges_on_edges(const ObstacleView& view, const CandidatePair& pair, const MovedTriangle& a,
                                  SweepResult& result) noexcept {
  const MeshSurface& surface = view.obstacle->mesh->surface;
  for (const std::uint32_t edge_a : scene_.tool_mesh()->surface.features()[pair.a].edges) {
    if (edge_a == MeshSurface::kNone) continue;
    for (const std::uint32_t edge_b : surface.features()[pair.b].edges)
      if (edge_b != MeshSurface::kNone &&
          (surface.sides_of(surface.convex_edges()[edge_b]) & view.sides) != 0)
        edge_on_edge(view, a, edge_a, edge_b, result);
  }
}

/// On a straight path the gap of two edges, times the length of their cross product N, is a quadratic
/// function of the path fraction: METHOD (95).
void MeshContacts::edge_on_edge(const ObstacleView& view, const MovedTriangle& a, std::uint32_t edge_a,
                                std::uint32_t edge_b, SweepResult& result) noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = view.obstacle->mesh->surface;
  const MeshSurface::Edge& eb = surface.convex_edges()[edge_b];
  // Finds the corners of the edge in the order of the triangle.
  std::size_t i = 0;
  while (tool.triangles()[a.triangle][i] != tool.convex_edges()[edge_a].vertices[0]) ++i;
  const std::size_t j = i == 2 ? 0 : i + 1;
  EdgePairMotion pass;
  pass.edge_a = edge_a;
  pass.edge_b = edge_b;
  pass.b0 = surface.vertices_m()[eb.vertices[0]];
  pass.db = surface.vertices_m()[eb.vertices[1]] - pass.b0;
  pass.a0_start = a.start[i];
  pass.a0_end = a.end[i];
  pass.da_start = a.start[j] - a.start[i];
  pass.da_end = a.end[j] - a.end[i];
  const Vector3d N_start = pass.da_start.cross(pass.db), N_end = pass.da_end.cross(pass.db);
  const double s_start = N_start.norm(), s_end = N_end.norm();
  const double parallel = sweep_tolerance::kParallel * pass.da_end.norm() * pass.db.norm();
  if (!(s_start > parallel) || !(s_end > parallel)) return;
  const Vector3d w_start = pass.a0_start - pass.b0, w_end = pass.a0_end - pass.b0;
  const OutwardPath outward =
      outward_path(surface, eb, tool, tool.convex_edges()[edge_a], view, N_start * N_start.dot(w_start));
  pass.sign = N_end.dot(outward.end) < 0.0 ? -1.0 : 1.0;
  // True if the edges become parallel on the path.
  const bool becomes_parallel = N_start.dot(outward.start) * pass.sign <= 0.0;
  const double f_start = pass.sign * N_start.dot(w_start), f_end = pass.sign * N_end.dot(w_end);
  const double f_middle = 0.5 * pass.sign * (N_start.dot(w_end) + N_end.dot(w_start));
  if (becomes_parallel) {
    // The contact would hold the end pose on one side and the start on the other. The sweep reports an
    // overlap, so that the caller tries a shorter path. Before the edges were parallel, outward was the
    // opposite direction.
    const double in = first_fall_through_zero(f_start, f_middle, f_end);
    const double out = first_fall_through_zero(-f_start, -f_middle, -f_end);
    const double parallel_fraction = s_start / (s_start + s_end);
    result.overlaps = result.overlaps ||
                      (in > parallel_fraction && in <= 1.0 && edges_touch(view, pass, in, feature_margin_m_));
    pass.sign = -pass.sign;
    result.overlaps = result.overlaps || (out < parallel_fraction && out >= 0.0 &&
                                          edges_touch(view, pass, out, feature_margin_m_));
    return;
  }
  const double start_m = f_start / s_start, end_m = f_end / s_end;
  if (start_m < -sweep_tolerance::kStart * clearance_m_) return;
  const bool open = end_m > (1.0 + sweep_tolerance::kClosing) * clearance_m_;
  if (open && f_middle >= 0.0) return;
  const double g_start = f_start - clearance_m_ * s_start, g_end = f_end - clearance_m_ * s_end;
  const double g_middle = f_middle - 0.5 * clearance_m_ * (s_start + s_end);
  const double crossing_fraction = std::clamp(first_fall_through_zero(g_start, g_middle, g_end), 0.0, 1.0);
  const bool closes = this->closes(start_m, end_m);
  if (closes) {
    if (!edges_touch(view, pass, crossing_fraction, feature_margin_m_)) return;
  } else if (open || !edges_touch(view, pass, 1.0, sweep_tolerance::kTouch * clearance_m_)) {
    // The edges separated again. If they overlapped deeply before, the path is too long.
    const double curvature = g_start - 2.0 * g_middle + g_end;
    const double lowest = curvature > 0.0 ? (g_start * g_end - g_middle * g_middle) / curvature : 0.0;
    const double dip_m = std::max(feature_margin_m_, sweep_tolerance::kDip * displacement_bound_m_);
    if (lowest < -dip_m * std::max(s_start, s_end) &&
        edges_touch(view, pass, crossing_fraction, feature_margin_m_))
      result.overlaps = true;
    return;
  }
  const Contact contact =
      edge_edge_contact(view, tool, edge_a, edge_b, pass.sign, N_end * (pass.sign / s_end));
  add_contact(closes, crossing_fraction, view.X_WO * pass.p, contact);
}

/// Returns true if the edges lie opposite each other at this path fraction and all their faces fall away from
/// the plane between them. Sets pass.p to the contact point.
bool MeshContacts::edges_touch(const ObstacleView& view, EdgePairMotion& pass, double fraction,
                               double tolerance_m) const noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = view.obstacle->mesh->surface;
  // The points where the two lines pass each other are a0 + x da and b0 + y db.
  const Vector3d a0 = interpolate(pass.a0_start, pass.a0_end, fraction),
                 da = interpolate(pass.da_start, pass.da_end, fraction);
  const Vector3d N = da.cross(pass.db), w = pass.b0 - a0;
  const double NN = N.squaredNorm();
  if (!(NN > 0.0)) return false;
  const double x = w.cross(pass.db).dot(N) / NN, y = w.cross(da).dot(N) / NN;
  const double tolerance_a = tolerance_m / da.norm(), tolerance_b = tolerance_m / pass.db.norm();
  if (x < -tolerance_a || x > 1.0 + tolerance_a || y < -tolerance_b || y > 1.0 + tolerance_b) return false;
  pass.p = pass.b0 + y * pass.db;
  const Vector3d n = N * (pass.sign / std::sqrt(NN));
  const auto falls_away = [&](const Vector3d& height_of, double side) {
    return side * n.dot(height_of) >= -slope_tolerance_ * height_of.norm();
  };
  if (slope_tolerance_ < sweep_tolerance::kAnySlope) {
    const MeshSurface::Edge &ea = tool.convex_edges()[pass.edge_a], &eb = surface.convex_edges()[pass.edge_b];
    if (view.sides == MeshSurface::kBothSides) {
      const Vector3d a_start = pass.a0_start + x * pass.da_start;
      if (is_behind_end(surface, eb, pass.p, pass.p + clearance_m_ * n, a_start)) return false;
    }
    if (tool_sides_ == MeshSurface::kBothSides) {
      const Vector3d p_T = point_on(tool, ea, x), n_T = view.X_OT_end.R.transpose() * n;
      if (is_behind_end(tool, ea, p_T, p_T - clearance_m_ * n_T, view.X_OT_start.inverse_transform(pass.p)))
        return false;
    }
  }
  for (const std::uint32_t t : surface.convex_edges()[pass.edge_b].triangles)
    for (int k = 0; k < 3 && t != MeshSurface::kNone; ++k)
      if (!falls_away(surface.corner_m(t, k) - pass.b0, -1.0)) return false;
  for (const std::uint32_t t : tool.convex_edges()[pass.edge_a].triangles)
    for (int k = 0; k < 3 && t != MeshSurface::kNone; ++k) {
      const Vector3d& p_T = tool.corner_m(t, k);
      if (!falls_away(interpolate(view.X_OT_start * p_T, view.X_OT_end * p_T, fraction) - a0, 1.0))
        return false;
    }
  return true;
}

/// A contact that does not close on the path touches at its end.
void MeshContacts::add_contact(bool closes, double path_fraction, const Vector3d& point_W_m,
                               const Contact& contact) noexcept {
  if (closes)
    crossings_.add(path_fraction, point_W_m, contact);
  else if (!touching_.contains(contact))
    touching_.add(contact);
}

}  // namespace wrenchd
