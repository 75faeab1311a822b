// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/mesh_contacts.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr std::size_t kMostCrossings = 512;
/// A pair is looked at in the time of so many visits; so many that the sieve left are found to be apart.
constexpr std::uint32_t kVisitsPerPair = 1;
constexpr std::size_t kPairsPerVisit = 2;
/// How far beyond its border a face or an edge still counts, in units of the clearance: far more than
/// rounding, far less than what keeps neighbours apart.
constexpr double kBeyond = 0.01;
/// A gap this much wider than the clearance is closed, and features this far beyond their border still hold,
/// in units of the clearance.
constexpr double kClosed = 0.1;
constexpr double kHolds = 1.0;
/// How far a gap may have been below zero at the start, in units of the clearance.
constexpr double kWasOpen = 0.5;
/// The slope by which the features around a contact may seem to lie nearer than the contact itself: the
/// straight way is not quite the true one.
constexpr double kSlope = 1e-3;
/// Where the end overlaps and nothing was seen to be crossed, crossings passed narrowly by a border: it is
/// looked at again with borders this much wider, as a share of the way, and with no regard to slopes.
constexpr double kWideBorder = 0.05;
constexpr double kAnySlope = 2.0;
/// Where a way turns no farther [rad], arc and chord differ by less than a hundred-thousandth of the tool's
/// size.
constexpr double kSureTurn_rad = 5e-3;
/// Crossings of much the same direction nearer than this count as one, in units of the way.
constexpr double kClose = 4.0;
constexpr double kSameWay = 0.9;  // cosine

Vector3d mix(const Vector3d& a, const Vector3d& b, double s) noexcept {
  return a + s * (b - a);
}

/// When on the way a gap has shrunk to the clearance.
double closing_time(double start_m, double end_m, double clearance_m) noexcept {
  return std::clamp((start_m - clearance_m) / (start_m - end_m), 0.0, 1.0);
}

/// When a (1 - t)^2 + 2 b t (1 - t) + c t^2 falls through zero; 2 where it never does.
double falls_through_zero(double a, double b, double c) noexcept {
  const double root2 = b * b - a * c;
  if (root2 < 0.0) return 2.0;
  const double root = std::sqrt(root2), fall = a - b;
  const double t = fall > 0.0 ? a / (fall + root) : (fall - root) / (fall + c - b);
  return std::isfinite(t) ? t : 2.0;
}

/// Does a point lie over a triangle with this normal, or no farther beyond its sides than so much?
bool over(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& normal,
          double beyond_m) noexcept {
  const auto within = [&](const Vector3d& from, const Vector3d& to) {
    const Vector3d along = to - from;
    const double outside = along.cross(normal).dot(p - from);
    return outside <= 0.0 || outside * outside <= beyond_m * beyond_m * along.squaredNorm();
  };
  return within(a, b) && within(b, c) && within(c, a);
}

}  // namespace

MeshContacts::MeshContacts(const Scene& scene) : scene_(scene), candidates_(scene) {
  crossings_.reserve(kMostCrossings);
  remaining_pairs_.resize(BvhTraversal::kCapacity);
  for (std::uint32_t k = 0; k < scene.meshes().size(); ++k) {
    const MeshObstacle& obstacle = scene.meshes()[k];
    obstacle_views_.push_back({&obstacle, scene.first_mesh() + k, Frame(obstacle.X_WO), {}, {}});
  }
}

void MeshContacts::set_start(const Pose& X_WT, double time_s) noexcept {
  X_start_ = X_WT;
  start_time_s_ = time_s;
}

void MeshContacts::prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s,
                            std::uint32_t to_spare) noexcept {
  candidates_.prefetch(X_WT, X_WP, budget, time_s, to_spare);
  overlap_found_ = false;
  sweep_visits_ = 0;
}

MeshContacts::SweepResult MeshContacts::sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget,
                                              double time_s) noexcept {
  SweepResult findings;
  touching_.clear();
  clearance_m_ = clearance_m;
  if (!candidates_.ensure_covers(X_start_, X_WT, {start_time_s_, time_s}, budget)) {
    findings.complete = false;
    findings.list_pending = candidates_.list_pending();
    return findings;
  }
  update_obstacle_views(X_WT, time_s);
  feature_margin_m_ = kBeyond * clearance_m + arc_deviation_m_;
  slope_tolerance_ = kSlope;
  test_pairs(budget, findings);
  if (findings.overlaps && crossings_.empty()) {
    feature_margin_m_ = kWideBorder * displacement_bound_m_;
    slope_tolerance_ = kAnySlope;
    test_pairs(budget, findings);
  }
  select_first_contacts(findings);
  if (findings.contacts.empty() && !findings.overlaps && (overlap_found_ || rotation_rad_ > kSureTurn_rad))
    verify_end_pose(budget, findings);
  return findings;
}

/// Whether any two triangles meet at the end. One that said so is asked about all shorter ways as well, until
/// the next tick.
void MeshContacts::verify_end_pose(VisitBudget& budget, SweepResult& findings) noexcept {
  const MeshBvh& tool = *scene_.tool_mesh();
  for (const std::uint32_t k : candidates_.current().nearby_obstacles()) {
    const MeshSurface& surface = obstacle_views_[k].obstacle->mesh->surface;
    const Frame& X_OT = obstacle_views_[k].X_OT_end;
    const Pose pose = {Quaterniond(X_OT.R), X_OT.x_m};
    findings.complete =
        traversal_.find(tool.bvh, obstacle_views_[k].obstacle->mesh->bvh, {pose, pose}, budget);
    if (!findings.complete) return;
    findings.overlaps = std::any_of(traversal_.begin(), traversal_.end(), [&](const TrianglePair& pair) {
      return triangles_intersect(
          {X_OT * tool.surface.corner_m(pair.a, 0), X_OT * tool.surface.corner_m(pair.a, 1),
           X_OT * tool.surface.corner_m(pair.a, 2)},
          {surface.corner_m(pair.b, 0), surface.corner_m(pair.b, 1), surface.corner_m(pair.b, 2)});
    });
    overlap_found_ = overlap_found_ || findings.overlaps;
    if (findings.overlaps) return;
  }
}

/// The way as each obstacle near by sees it.
void MeshContacts::update_obstacle_views(const Pose& X_WT, double time_s) noexcept {
  const Frame start(X_start_), end(X_WT);
  displacement_bound_m_ = candidates_.current().displacement_bound_m(X_start_, X_WT);
  rotation_rad_ = X_start_.rotation.angularDistance(X_WT.rotation);
  for (const std::uint32_t k : candidates_.current().nearby_obstacles()) {
    ObstacleView& seen = obstacle_views_[k];
    if (!seen.obstacle->moves()) {
      seen.X_OT_start = start.relative_to(seen.X_WO);
      seen.X_OT_end = end.relative_to(seen.X_WO);
      continue;
    }
    const Pose X_WO_start = seen.obstacle->X_WO_at(start_time_s_), X_WO_end = seen.obstacle->X_WO_at(time_s);
    const Pose X_OT_start = inverse(X_WO_start) * X_start_, X_OT_end = inverse(X_WO_end) * X_WT;
    seen.X_WO = Frame(X_WO_end);
    seen.X_OT_start = start.relative_to(Frame(X_WO_start));
    seen.X_OT_end = end.relative_to(seen.X_WO);
    displacement_bound_m_ =
        std::max(displacement_bound_m_, candidates_.current().displacement_bound_m(X_OT_start, X_OT_end));
    rotation_rad_ = std::max(rotation_rad_, X_OT_start.rotation.angularDistance(X_OT_end.rotation));
  }
  // The way of a vertex is straight as long as nothing turns.
  arc_deviation_m_ = 0.25 * rotation_rad_ * rotation_rad_ * scene_.tool_radius_m();
}

/// Most pairs are kept apart all the way by the plane of one of the two: those are left out first.
void MeshContacts::test_pairs(VisitBudget& budget, SweepResult& findings) noexcept {
  touching_.clear();
  crossings_.clear();
  moved_triangle_.triangle = MeshSurface::kNone;
  PairCuller& sieve = candidates_.culler();
  const double tool_m = scene_.tool_mesh()->bvh.extent_m();
  for (std::size_t k = 0; k < sieve.groups().size(); ++k) {
    const ObstacleView& seen = obstacle_views_[sieve.groups()[k].obstacle];
    const PairCuller::CullResult sifted =
        sieve.cull(k, seen.X_OT_start, seen.X_OT_end, tool_m + seen.obstacle->mesh->bvh.extent_m(),
                   feature_margin_m_ + arc_deviation_m_ + 2.0 * clearance_m_, remaining_pairs_.data());
    const auto sieving = static_cast<std::uint32_t>(sifted.tested / PredictiveCandidateList::kPairsPerVisit);
    tested_pairs_ = 0;
    for (const std::uint32_t i : std::span(remaining_pairs_).first(sifted.remaining)) {
      const CandidatePair& pair = candidates_.current().pairs()[i];
      test_pair(pair, moved_triangle(pair), findings);
    }
    const auto looking =
        static_cast<std::uint32_t>(sifted.remaining / kPairsPerVisit) + kVisitsPerPair * tested_pairs_;
    budget.remaining -= std::min(budget.remaining, sieving + looking);
    sweep_visits_ += sieving + looking;
  }
}

const MeshContacts::MovedTriangle& MeshContacts::moved_triangle(const CandidatePair& pair) noexcept {
  if (moved_triangle_.triangle == pair.a && moved_triangle_.obstacle == pair.obstacle) return moved_triangle_;
  const ObstacleView& seen = obstacle_views_[pair.obstacle];
  moved_triangle_.triangle = pair.a;
  moved_triangle_.obstacle = pair.obstacle;
  for (int i = 0; i < 3; ++i) {
    const Vector3d& p_T = scene_.tool_mesh()->surface.corner_m(pair.a, i);
    const auto k = static_cast<std::size_t>(i);
    moved_triangle_.start[k] = seen.X_OT_start * p_T;
    moved_triangle_.end[k] = seen.X_OT_end * p_T;
  }
  const MeshSurface::Plane& plane = scene_.tool_mesh()->surface.planes()[pair.a];
  const auto plane_in_O = [&](const Frame& X_OT) -> MeshSurface::Plane {
    const Vector3d normal = X_OT.R * plane.normal;
    return {normal, plane.offset_m + normal.dot(X_OT.x_m)};
  };
  moved_triangle_.plane_start = plane_in_O(seen.X_OT_start);
  moved_triangle_.plane_end = plane_in_O(seen.X_OT_end);
  return moved_triangle_;
}

/// A pair that has less room than the clearance from the start is closed by what narrows it further.
bool MeshContacts::closes(double start_m, double end_m) const noexcept {
  return end_m < (1.0 - kClosed) * clearance_m_ && end_m < start_m - kClosed * clearance_m_;
}

/// Does a plane keep a triangle on one side at both ends of the way, and so all the way? By at least so much
/// at the start.
bool MeshContacts::plane_separates(const Heights& start_m, const Heights& end_m,
                                   double least_m) const noexcept {
  if (std::min({end_m[0], end_m[1], end_m[2]}) > (1.0 + kClosed) * clearance_m_ + least_m)
    return std::min({start_m[0], start_m[1], start_m[2]}) >= least_m;
  if (std::max({end_m[0], end_m[1], end_m[2]}) < -clearance_m_ - least_m)
    return std::max({start_m[0], start_m[1], start_m[2]}) <= -least_m;
  return false;
}

void MeshContacts::test_pair(const CandidatePair& pair, const MovedTriangle& a,
                             SweepResult& findings) noexcept {
  const ObstacleView& seen = obstacle_views_[pair.obstacle];
  const MeshSurface& surface = seen.obstacle->mesh->surface;
  const Triangle b = {surface.corner_m(pair.b, 0), surface.corner_m(pair.b, 1), surface.corner_m(pair.b, 2)};
  if (separating_axes_.separated(a.start, a.end, b,
                                 feature_margin_m_ + arc_deviation_m_ + 2.0 * clearance_m_))
    return;
  const MeshSurface::Plane& plane = surface.planes()[pair.b];
  const auto heights = [](const MeshSurface::Plane& over, const Triangle& triangle) -> Heights {
    return {over.normal.dot(triangle[0]) - over.offset_m, over.normal.dot(triangle[1]) - over.offset_m,
            over.normal.dot(triangle[2]) - over.offset_m};
  };
  const Heights a_end = heights(plane, a.end);
  if (plane_separates(heights(plane, a.start), a_end, 0.0)) return;
  // Seen from the tool the obstacle's way bulges a little.
  if (plane_separates(heights(a.plane_start, b), heights(a.plane_end, b), arc_deviation_m_)) return;
  ++tested_pairs_;
  const std::size_t before = crossings_.size();
  vertices_on_face(seen, pair, a);
  face_on_vertices(seen, pair);
  edges_on_edges(seen, pair, a, findings);
  if (crossings_.size() > before || findings.overlaps) return;
  if (std::min({a_end[0], a_end[1], a_end[2]}) > 0.0 || std::max({a_end[0], a_end[1], a_end[2]}) < 0.0)
    return;
  findings.overlaps = triangles_intersect(a.end, b);
}

/// Contacts of a vertex of the tool and a face of the obstacle. The way is straight in the obstacle's frame,
/// so the gap is linear in time, exactly.
void MeshContacts::vertices_on_face(const ObstacleView& seen, const CandidatePair& pair,
                                    const MovedTriangle& a) noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = seen.obstacle->mesh->surface;
  const auto& vertices = tool.features()[pair.a].vertices;
  for (std::size_t i = 0; i < 3; ++i) {
    if (vertices[i] == MeshSurface::kNone) continue;
    MeshSurface::Plane plane = surface.planes()[pair.b];
    double start_m = plane.normal.dot(a.start[i]) - plane.offset_m;
    double end_m = plane.normal.dot(a.end[i]) - plane.offset_m;
    if (surface.kind() == MeshSurface::Kind::surface && start_m < 0.0) {  // it has two sides
      plane = {-plane.normal, -plane.offset_m};
      start_m = -start_m;
      end_m = -end_m;
    }
    if (end_m > (1.0 + kClosed) * clearance_m_ || start_m < -kWasOpen * clearance_m_) continue;
    const bool closes = this->closes(start_m, end_m);
    const double when = closes ? closing_time(start_m, end_m, clearance_m_) : 1.0;
    const Vector3d p = mix(a.start[i], a.end[i], when);
    if (!over(p, surface.corner_m(pair.b, 0), surface.corner_m(pair.b, 1), surface.corner_m(pair.b, 2),
              surface.planes()[pair.b].normal, closes ? feature_margin_m_ : kHolds * clearance_m_))
      continue;
    const Vector3d& p_T = tool.vertices_m()[vertices[i]];
    bool first = true;
    for (const std::uint32_t v : tool.ring_of(vertices[i])) {
      const Vector3d& q_T = tool.vertices_m()[v];
      const Vector3d q = mix(seen.X_OT_start * q_T, seen.X_OT_end * q_T, when);
      first = first && plane.normal.dot(q - p) >= -slope_tolerance_ * (q_T - p_T).norm();
    }
    if (!first) continue;
    Contact contact;
    contact.kind = ContactKind::vertex_face;
    contact.p_TCa_m = p_T;
    contact.n_W = seen.X_WO.R * plane.normal;
    contact.p_WCb_m = seen.X_WO * (plane.offset_m * plane.normal);
    contact.offset_m = plane.offset_m + contact.n_W.dot(seen.X_WO.x_m);
    contact.tool_feature = vertices[i];
    contact.obstacle_feature = surface.planar_region(pair.b);
    contact.obstacle = seen.number;
    if (closes)
      add_crossing(when, seen.X_WO * p, contact);
    else if (!touching_.contains(contact))
      touching_.add(contact);
  }
}

/// The same the other way round: seen from the tool, the obstacle's vertex moves.
void MeshContacts::face_on_vertices(const ObstacleView& seen, const CandidatePair& pair) noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = seen.obstacle->mesh->surface;
  const MeshSurface::Plane& plane = tool.planes()[pair.a];
  for (const std::uint32_t vertex : surface.features()[pair.b].vertices) {
    if (vertex == MeshSurface::kNone) continue;
    const Vector3d& p_O = surface.vertices_m()[vertex];
    const Vector3d p_end = seen.X_OT_end.inverse_transform(p_O);
    const double end_m = plane.normal.dot(p_end) - plane.offset_m;
    if (end_m > (1.0 + kClosed) * clearance_m_) continue;
    const Vector3d p_start = seen.X_OT_start.inverse_transform(p_O);
    const double start_m = plane.normal.dot(p_start) - plane.offset_m;
    if (start_m < -kWasOpen * clearance_m_) continue;
    const bool closes = this->closes(start_m, end_m);
    const double when = closes ? closing_time(start_m, end_m, clearance_m_) : 1.0;
    const Vector3d p = mix(p_start, p_end, when);
    if (!over(p, tool.corner_m(pair.a, 0), tool.corner_m(pair.a, 1), tool.corner_m(pair.a, 2), plane.normal,
              closes ? feature_margin_m_ : kHolds * clearance_m_))
      continue;
    bool first = true;
    for (const std::uint32_t v : surface.ring_of(vertex)) {
      const Vector3d& q_O = surface.vertices_m()[v];
      const Vector3d q =
          mix(seen.X_OT_start.inverse_transform(q_O), seen.X_OT_end.inverse_transform(q_O), when);
      first = first && plane.normal.dot(q - p) >= -slope_tolerance_ * (q_O - p_O).norm();
    }
    // The lone vertices of a surface may have anything beside them.
    if (!first && surface.kind() == MeshSurface::Kind::solid) continue;
    Contact contact;
    contact.kind = ContactKind::face_vertex;
    contact.d_T = -plane.normal;
    contact.p_TCa_m = plane.offset_m * plane.normal;
    contact.p_WCb_m = seen.X_WO * p_O;
    contact.n_W = seen.X_WO.R * (seen.X_OT_end.R * contact.d_T);
    contact.tool_feature = tool.planar_region(pair.a);
    contact.obstacle_feature = vertex;
    contact.obstacle = seen.number;
    if (closes)
      add_crossing(when, contact.p_WCb_m, contact);
    else if (!touching_.contains(contact))
      touching_.add(contact);
  }
}

void MeshContacts::edges_on_edges(const ObstacleView& seen, const CandidatePair& pair, const MovedTriangle& a,
                                  SweepResult& findings) noexcept {
  for (const std::uint32_t edge_a : scene_.tool_mesh()->surface.features()[pair.a].edges) {
    if (edge_a == MeshSurface::kNone) continue;
    for (const std::uint32_t edge_b : seen.obstacle->mesh->surface.features()[pair.b].edges)
      if (edge_b != MeshSurface::kNone) edge_on_edge(seen, a, edge_a, edge_b, findings);
  }
}

/// On a straight way the gap of two edges, times the length of their cross product N, is quadratic in time.
void MeshContacts::edge_on_edge(const ObstacleView& seen, const MovedTriangle& a, std::uint32_t edge_a,
                                std::uint32_t edge_b, SweepResult& findings) noexcept {
  constexpr double kParallel = 1e-7;  // sine: they have no common normal to rely on
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = seen.obstacle->mesh->surface;
  const MeshSurface::Edge& eb = surface.convex_edges()[edge_b];
  // The corners of the triangle are at hand, in its own order.
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
  const double parallel = kParallel * pass.da_end.norm() * pass.db.norm();
  if (!(s_start > parallel) || !(s_end > parallel)) return;
  // Which way is out: away from both faces of the obstacle, towards those of the tool.
  const Vector3d w_start = pass.a0_start - pass.b0, w_end = pass.a0_end - pass.b0;
  bool turned_past = false;  // parallel
  if (surface.kind() == MeshSurface::Kind::surface) {
    pass.sign = N_start.dot(w_start) < 0.0 ? -1.0 : 1.0;
  } else {
    const Vector3d out = surface.planes()[eb.triangles[0]].normal + surface.planes()[eb.triangles[1]].normal;
    pass.sign = N_end.dot(out) < 0.0 ? -1.0 : 1.0;
    turned_past = N_start.dot(out) * pass.sign <= 0.0;
  }
  const double f_start = pass.sign * N_start.dot(w_start), f_end = pass.sign * N_end.dot(w_end);
  const double f_middle = 0.5 * pass.sign * (N_start.dot(w_end) + N_end.dot(w_start));
  if (turned_past) {
    // The contact would hold the end pose out on one side and the start on the other: a shorter way is asked
    // for. Before they were parallel, out was the other way.
    const double in = falls_through_zero(f_start, f_middle, f_end);
    const double out = falls_through_zero(-f_start, -f_middle, -f_end);
    const double flips = s_start / (s_start + s_end);
    findings.overlaps =
        findings.overlaps || (in > flips && in <= 1.0 && edges_touch(seen, pass, in, feature_margin_m_));
    pass.sign = -pass.sign;
    findings.overlaps =
        findings.overlaps || (out < flips && out >= 0.0 && edges_touch(seen, pass, out, feature_margin_m_));
    return;
  }
  const double start_m = f_start / s_start, end_m = f_end / s_end;
  if (start_m < -kWasOpen * clearance_m_) return;
  const bool open = end_m > (1.0 + kClosed) * clearance_m_;
  if (open && f_middle >= 0.0) return;
  const double g_start = f_start - clearance_m_ * s_start, g_end = f_end - clearance_m_ * s_end;
  const double g_middle = f_middle - 0.5 * clearance_m_ * (s_start + s_end);
  const double crosses = std::clamp(falls_through_zero(g_start, g_middle, g_end), 0.0, 1.0);
  const bool closes = this->closes(start_m, end_m);
  if (closes) {
    if (!edges_touch(seen, pass, crosses, feature_margin_m_)) return;
  } else if (open || !edges_touch(seen, pass, 1.0, kHolds * clearance_m_)) {
    // They came off each other. Where they were deep before they did, others were not seen to be met: the way
    // is too long.
    const double bend = g_start - 2.0 * g_middle + g_end;
    const double lowest = bend > 0.0 ? (g_start * g_end - g_middle * g_middle) / bend : 0.0;
    if (lowest < -feature_margin_m_ * std::max(s_start, s_end) &&
        edges_touch(seen, pass, crosses, feature_margin_m_))
      findings.overlaps = true;
    return;
  }
  const MeshSurface::Edge& ea = tool.convex_edges()[edge_a];
  Contact contact;
  contact.kind = ContactKind::edge_edge;
  contact.p_TCa_m = tool.vertices_m()[ea.vertices[0]];
  contact.d_T = (tool.vertices_m()[ea.vertices[1]] - contact.p_TCa_m).normalized();
  contact.p_WCb_m = seen.X_WO * pass.b0;
  contact.d_W = seen.X_WO.R * (pass.db * (pass.sign / pass.db.norm()));
  contact.n_W = seen.X_WO.R * (N_end * (pass.sign / s_end));
  contact.tool_feature = edge_a;
  contact.obstacle_feature = edge_b;
  contact.obstacle = seen.number;
  if (closes)
    add_crossing(crosses, seen.X_WO * pass.p, contact);
  else if (!touching_.contains(contact))
    touching_.add(contact);
}

/// Do two edges lie opposite each other at this time, with all four faces falling away from the plane between
/// them? pass.p is where.
bool MeshContacts::edges_touch(const ObstacleView& seen, EdgePairMotion& pass, double when,
                               double beyond_m) const noexcept {
  const MeshSurface& tool = scene_.tool_mesh()->surface;
  const MeshSurface& surface = seen.obstacle->mesh->surface;
  // Where the two lines pass each other: a0 + x da and b0 + y db.
  const Vector3d a0 = mix(pass.a0_start, pass.a0_end, when), da = mix(pass.da_start, pass.da_end, when);
  const Vector3d N = da.cross(pass.db), w = pass.b0 - a0;
  const double NN = N.squaredNorm();
  if (!(NN > 0.0)) return false;
  const double x = w.cross(pass.db).dot(N) / NN, y = w.cross(da).dot(N) / NN;
  const double beyond_a = beyond_m / da.norm(), beyond_b = beyond_m / pass.db.norm();
  if (x < -beyond_a || x > 1.0 + beyond_a || y < -beyond_b || y > 1.0 + beyond_b) return false;
  pass.p = pass.b0 + y * pass.db;
  const Vector3d n = N * (pass.sign / std::sqrt(NN));
  const auto falls_away = [&](const Vector3d& height_of, double side) {
    return side * n.dot(height_of) >= -slope_tolerance_ * height_of.norm();
  };
  if (surface.kind() == MeshSurface::Kind::solid)
    for (const std::uint32_t t : surface.convex_edges()[pass.edge_b].triangles)
      for (int k = 0; k < 3; ++k)
        if (!falls_away(surface.corner_m(t, k) - pass.b0, -1.0)) return false;
  for (const std::uint32_t t : tool.convex_edges()[pass.edge_a].triangles)
    for (int k = 0; k < 3; ++k) {
      const Vector3d& p_T = tool.corner_m(t, k);
      if (!falls_away(mix(seen.X_OT_start * p_T, seen.X_OT_end * p_T, when) - a0, 1.0)) return false;
    }
  return true;
}

/// Where there is no room left, a later one gives way to an earlier.
void MeshContacts::add_crossing(double when, const Vector3d& point_W_m, const Contact& contact) noexcept {
  if (crossings_.size() < crossings_.capacity()) {
    crossings_.push_back({when, point_W_m, contact});
    return;
  }
  const auto last = std::max_element(
      crossings_.begin(), crossings_.end(),
      [](const Crossing& a, const Crossing& b) { return a.path_fraction < b.path_fraction; });
  if (when < last->path_fraction) *last = {when, point_W_m, contact};
}

void MeshContacts::select_first_contacts(SweepResult& findings) noexcept {
  if (crossings_.empty()) return;
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& a, const Crossing& b) {
    if (a.path_fraction != b.path_fraction) return a.path_fraction < b.path_fraction;
    if (a.contact.tool_feature != b.contact.tool_feature)
      return a.contact.tool_feature < b.contact.tool_feature;
    return a.contact.obstacle_feature < b.contact.obstacle_feature;
  });
  const double close_m = std::min(kClose * displacement_bound_m_, 0.25 * scene_.tool_radius_m());
  StaticVector<Vector3d, kMaxContacts> points;
  for (const Crossing& crossing : crossings_) {
    bool beside = false;
    for (std::size_t i = 0; i < points.size() && !beside; ++i)
      beside = (points[i] - crossing.point_W_m).squaredNorm() < close_m * close_m &&
               findings.contacts[i].n_W.dot(crossing.contact.n_W) > kSameWay;
    if (beside || !findings.contacts.add(crossing.contact)) continue;
    points.add(crossing.point_W_m);
  }
}

}  // namespace wrenchd
