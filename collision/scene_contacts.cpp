// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/scene_contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace wrenchd {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Edges whose angle is below this [rad] have no usable common normal.
constexpr double kParallel = 1e-7;
/// Features touch a plane within this distance, in units of the tool's radius.
constexpr double kTouchDistance = 1e-7;
/// Tolerance of the centre-of-pressure test, in units of the tool's radius.
constexpr double kPressureTolerance = 1e-8;
/// With at most this number of faces it is faster to test all of them.
constexpr std::size_t kMaxAllFaces = 16;
/// Normals that differ by less belong to the same plane.
constexpr double kSamePlane = 1e-9;

/// Returns true if a plane with outward normal m touches the body along this edge. The tolerance includes a
/// plane along one of the edge's faces.
bool touches_along(const ConvexBody::Edge& edge, const Vector3d& m) noexcept {
  const double least = -kSamePlane * m.norm();
  return m.dot(edge.side[0]) >= least && m.dot(edge.side[1]) >= least;
}

/// Returns the edge at a vertex that is parallel to d; null if there is none.
const ConvexBody::Edge* edge_along(const ConvexBody& body, std::uint32_t vertex, const Vector3d& d) noexcept {
  constexpr double kAlong = 1.0 - 0.5 * kParallel * kParallel;  // cosine
  for (const std::uint32_t e : body.edges_of(vertex))
    if (std::abs(body.edges[e].d.dot(d)) > kAlong) return &body.edges[e];
  return nullptr;
}

/// The gap of two edges is equal at all their points, so the edge's first vertex represents the second.
std::uint32_t first_end(const ConvexBody& body, std::uint32_t vertex, const Vector3d& d) noexcept {
  const ConvexBody::Edge* edge = edge_along(body, vertex, d);
  return edge != nullptr ? edge->from : vertex;
}

/// Returns true if a point of an edge's line lies between the ends of the edge.
bool between_ends(const ConvexBody& body, const ConvexBody::Edge& edge, const Vector3d& p_m,
                  double tolerance_m) noexcept {
  return edge.d.dot(p_m - body.vertices_T_m[edge.from]) >= -tolerance_m &&
         edge.d.dot(p_m - body.vertices_T_m[edge.to]) <= tolerance_m;
}

/// Returns true if two planes are fixed to the same features.
bool same_plane(const SeparatingPlane& a, const SeparatingPlane& b) noexcept {
  if (a.kind != b.kind) return false;
  if (a.kind == ContactKind::vertex_face) return (a.n_W - b.n_W).norm() < kSamePlane;
  return a.d_T == b.d_T && a.d_W == b.d_W;
}

}  // namespace

SceneContacts::SceneContacts(const Scene& scene)
    : scene_(scene),
      half_spaces_(scene),
      planes_(scene.convex().size()),
      survey_best_(planes_),
      last_nearest_(planes_.size()) {
  candidates_.reserve(kMaxCandidates);
  survey_candidates_.reserve(kMaxSurveyPlanes);
  std::size_t max_contacts = scene.tool().hull.vertices_T_m.size();
  for (const ConvexObstacle& obstacle : scene.convex())
    max_contacts = std::max(max_contacts, obstacle.body.vertices_T_m.size());
  touching_vertices_.reserve(max_contacts);
  obstacle_touching_vertices_.reserve(max_contacts);
}

std::size_t SceneContacts::add_violated(const Pose& pose, double tolerance_m,
                                        ContactSet& contacts) const noexcept {
  const Frame X_WT(pose);
  const std::size_t before = contacts.size();
  half_spaces_.add_violated(X_WT, tolerance_m, contacts);
  for (std::uint32_t k = 0; k < scene_.convex().size(); ++k)
    add_convex(k, X_WT, tolerance_m, HalfSpaceContacts::kMaxPerObstacle, contacts);
  return contacts.size() - before;
}

void SceneContacts::add_touching(const Pose& pose, double within_m, ContactSet& contacts) const noexcept {
  const Frame X_WT(pose);
  half_spaces_.add_touching(X_WT, within_m, contacts);
  for (std::uint32_t k = 0; k < scene_.convex().size(); ++k)
    add_convex(k, X_WT, -within_m, ContactSet::kCapacity, contacts);
}

bool SceneContacts::admits(const Pose& pose, double tolerance_m) const noexcept {
  const Frame X_WT(pose);
  if (!half_spaces_.admits(X_WT, tolerance_m)) return false;
  for (std::uint32_t k = 0; k < planes_.size(); ++k)
    if (!out_of_reach(k, X_WT) && !separates(k, X_WT, tolerance_m)) return false;
  return true;
}

void SceneContacts::select_admitting_planes(const Pose& pose, double tolerance_m) noexcept {
  const Frame X_WT(pose);
  for (std::uint32_t k = 0; k < planes_.size(); ++k) {
    if (separates(k, X_WT, tolerance_m)) continue;
    candidates_.clear();
    if (out_of_reach(k, X_WT))
      add_centre_line_candidate(k, X_WT);
    else
      add_widest_gap_candidate(k, X_WT);
    if (candidates_
            .empty()) {  // touching bodies: no plane has positive width, but one of these has width zero
      add_face_candidates(k, X_WT);
      add_edge_pair_candidates(k, X_WT);
      sort_candidates();
    }
    if (!candidates_.empty()) hold_alternative(0);
  }
}

bool SceneContacts::out_of_reach(std::uint32_t k, const Frame& X_WT) const noexcept {
  const ConvexObstacle& obstacle = scene_.convex()[k];
  const double reach = scene_.tool_radius_m() + obstacle.radius_m;
  return (X_WT.x_m - obstacle.centre_W_m).squaredNorm() > reach * reach;
}

/// Parallel edges have no common normal. The plane then keeps the normal of the pose where it was selected.
SceneContacts::PlaneNormal SceneContacts::normal_of(const SeparatingPlane& plane,
                                                    const Frame& X_WT) noexcept {
  switch (plane.kind) {
    case ContactKind::vertex_face:
      break;
    case ContactKind::face_vertex:
      return {X_WT.R * plane.d_T, false};
    case ContactKind::edge_edge: {
      const Vector3d N = (X_WT.R * plane.d_T).cross(plane.d_W);
      const double s = N.norm();
      return s > kParallel ? PlaneNormal{N * (1.0 / s), false} : PlaneNormal{plane.n_W, true};
    }
  }
  return {plane.n_W, false};
}

/// Returns true if the bounding spheres of tool and obstacle are apart along n. This decides most obstacles.
bool SceneContacts::spheres_separated(std::uint32_t k, const Vector3d& n_W,
                                      const Frame& X_WT) const noexcept {
  const ConvexObstacle& obstacle = scene_.convex()[k];
  return n_W.dot(X_WT.x_m - obstacle.centre_W_m) > scene_.tool_radius_m() + obstacle.radius_m;
}

/// Returns the vertices of both bodies that are nearest to each other along a normal, and their separation:
/// METHOD (28).
SceneContacts::PlaneSeparation SceneContacts::plane_separation(std::uint32_t k, const PlaneNormal& normal,
                                                               const Frame& X_WT) const noexcept {
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;
  const Vector3d& n_W = normal.n_W;
  VertexPair& nearest = last_nearest_[k];
  nearest.tool_vertex = tool.support(X_WT.R.transpose() * -n_W, nearest.tool_vertex);
  nearest.obstacle_vertex = obstacle.support(n_W, nearest.obstacle_vertex);
  return {n_W, nearest, separation_m(k, n_W, nearest, X_WT), normal.degenerate};
}

/// Returns the separation of a vertex pair along a normal.
double SceneContacts::separation_m(std::uint32_t k, const Vector3d& n_W, VertexPair pair,
                                   const Frame& X_WT) const noexcept {
  const Vector3d a_W = X_WT * scene_.tool().hull.vertices_T_m[pair.tool_vertex];
  return n_W.dot(a_W - scene_.convex()[k].body.vertices_T_m[pair.obstacle_vertex]);
}

bool SceneContacts::separates(std::uint32_t k, const Frame& X_WT, double tolerance_m) const noexcept {
  const PlaneNormal normal = normal_of(planes_[k], X_WT);
  return spheres_separated(k, normal.n_W, X_WT) ||
         plane_separation(k, normal, X_WT).separation_m >= -tolerance_m;
}

/// Adds the deepest pair and those of its neighbours that lie beyond the plane: neighbours on the tool if the
/// plane belongs to the obstacle, otherwise neighbours on the obstacle.
void SceneContacts::add_convex(std::uint32_t k, const Frame& X_WT, double tolerance_m,
                               std::size_t max_contacts, ContactSet& contacts) const noexcept {
  const SeparatingPlane& plane = planes_[k];
  const PlaneNormal normal = normal_of(plane, X_WT);
  if (spheres_separated(k, normal.n_W, X_WT)) return;
  const PlaneSeparation at = plane_separation(k, normal, X_WT);
  if (at.separation_m >= -tolerance_m) return;
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;

  Contact contact;
  contact.kind = at.degenerate ? ContactKind::vertex_face : plane.kind;
  contact.n_W = at.n_W;
  contact.obstacle = static_cast<std::uint32_t>(scene_.half_spaces().size()) + k;
  if (contact.kind != ContactKind::vertex_face) contact.d_T = plane.d_T;
  if (contact.kind == ContactKind::edge_edge) contact.d_W = plane.d_W;
  const auto add = [&](std::uint32_t a, std::uint32_t b) {
    if (contact.kind == ContactKind::edge_edge) {
      a = first_end(tool, a, plane.d_T);
      b = first_end(obstacle, b, plane.d_W);
    }
    contact.p_TCa_m = tool.vertices_T_m[a];
    contact.p_WCb_m = obstacle.vertices_T_m[b];
    contact.offset_m = contact.n_W.dot(contact.p_WCb_m);
    contact.tool_feature = a;
    contact.obstacle_feature = b;
    if (!contacts.contains(contact)) contacts.add(contact);
  };

  add(at.nearest.tool_vertex, at.nearest.obstacle_vertex);
  std::size_t room = max_contacts - 1;
  const bool tool_side = contact.kind == ContactKind::vertex_face;
  const ConvexBody& body = tool_side ? tool : obstacle;
  const std::uint32_t deepest = tool_side ? at.nearest.tool_vertex : at.nearest.obstacle_vertex;
  const Vector3d up = tool_side ? Vector3d(X_WT.R.transpose() * at.n_W) : Vector3d(-at.n_W);
  const double below_m = -tolerance_m - at.separation_m;
  for (const std::uint32_t v : body.ring_of(deepest)) {
    if (up.dot(body.vertices_T_m[v] - body.vertices_T_m[deepest]) >= below_m) continue;
    const std::size_t known = contacts.size();
    if (tool_side)
      add(v, at.nearest.obstacle_vertex);
    else
      add(at.nearest.tool_vertex, v);
    if (contacts.size() > known && --room == 0) return;
  }
}

bool SceneContacts::planes_optimal(const Projection& q) noexcept {
  for (std::uint32_t k = 0; k < scene_.convex().size(); ++k)
    if (!plane_optimal(k, q)) return false;
  return true;
}

/// Returns the mean of the contact points with one obstacle, weighted with their multipliers; nothing if no
/// contact is loaded.
std::optional<SceneContacts::PressureCentre> SceneContacts::pressure_of(std::uint32_t k,
                                                                        const Projection& q) const noexcept {
  const auto number = static_cast<std::uint32_t>(scene_.half_spaces().size()) + k;
  PressureCentre out;
  double sum = 0.0;
  for (const auto& [contact, multiplier] : q.active) {
    if (contact.obstacle != number || !(multiplier > 0.0)) continue;
    out.pair = {contact.tool_feature, contact.obstacle_feature};
    out.centre_W_m += multiplier * contact_point_W(contact, q.X_WQ);
    ++out.contacts;
    sum += multiplier;
  }
  if (out.contacts == 0) return std::nullopt;
  out.centre_W_m /= sum;
  return out;
}

// METHOD (30). The forces of one obstacle's contacts all act along n. They are in equilibrium on a plane that
// may tilt if the centre of pressure c = sum m_i c_i / sum m_i lies in the tool and in the obstacle.
bool SceneContacts::plane_optimal(std::uint32_t k, const Projection& q) noexcept {
  const auto pressure = pressure_of(k, q);
  if (!pressure) return true;
  const SeparatingPlane& plane = planes_[k];
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;
  const Frame X_WT(q.X_WQ);
  const Vector3d& centre_W = pressure->centre_W_m;
  const Vector3d centre_T = X_WT.R.transpose() * (centre_W - X_WT.x_m);
  const auto [a, b] = pressure->pair;
  if (plane.kind == ContactKind::edge_edge && pressure->contacts == 1) {
    const auto* tool_edge = edge_along(tool, a, plane.d_T);
    const auto* obstacle_edge = edge_along(obstacle, b, plane.d_W);
    const double tolerance_m = kPressureTolerance * scene_.tool_radius_m();
    if (tool_edge != nullptr && obstacle_edge != nullptr)
      return between_ends(tool, *tool_edge, centre_T, tolerance_m) &&
             between_ends(obstacle, *obstacle_edge, centre_W, tolerance_m);
  }
  // A mean of vertices lies in their body.
  const Vector3d n_W = normal_of(plane, X_WT).n_W;
  return (plane.kind == ContactKind::face_vertex || contains(obstacle, n_W, b, centre_W)) &&
         (plane.kind == ContactKind::vertex_face || contains(tool, X_WT.R.transpose() * -n_W, a, centre_T));
}

/// Returns true if a body contains a point of the plane that touches it at vertex `farthest` with this
/// outward normal. Only faces that meet the plane can exclude the point.
bool SceneContacts::contains(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
                             const Vector3d& p_m) noexcept {
  const double tolerance_m = kPressureTolerance * scene_.tool_radius_m();
  const auto under_plane = [&](const ConvexBody::Face& face) {
    return face.n.dot(p_m) <= face.offset_m + tolerance_m;
  };
  if (body.faces.size() <= kMaxAllFaces)
    return std::all_of(body.faces.begin(), body.faces.end(), under_plane);
  collect_touching(body, normal, farthest, touching_vertices_);
  for (const std::uint32_t v : touching_vertices_)
    for (const std::uint32_t f : body.faces_of(v))
      if (!under_plane(body.faces[f])) return false;
  return true;
}

/// Adds a plane as a candidate if its separation is sufficient.
void SceneContacts::add_candidate(std::uint32_t k, SeparatingPlane plane, const Frame& X_WT,
                                  double least_separation_m) noexcept {
  const PlaneNormal normal = normal_of(plane, X_WT);
  // Any vertex pair yields an upper bound of the separation. It excludes most planes.
  if (normal.degenerate || separation_m(k, normal.n_W, last_nearest_[k], X_WT) < least_separation_m) return;
  const PlaneSeparation at = plane_separation(k, normal, X_WT);
  if (!(at.separation_m >= least_separation_m)) return;
  for (const PlaneCandidate& candidate : candidates_)
    if (candidate.obstacle == k && same_plane(candidate.plane, plane)) return;
  plane.n_W = at.n_W;
  if (candidates_.size() == kMaxCandidates) {
    const auto worst = std::min_element(
        candidates_.begin(), candidates_.end(),
        [](const PlaneCandidate& x, const PlaneCandidate& y) { return x.separation_m < y.separation_m; });
    if (worst->separation_m >= at.separation_m) return;
    *worst = {k, plane, at.separation_m, at.nearest};
    return;
  }
  candidates_.push_back({k, plane, at.separation_m, at.nearest});
}

/// Separate spheres are separated along the line between their centres.
void SceneContacts::add_centre_line_candidate(std::uint32_t k, const Frame& X_WT) noexcept {
  const Vector3d apart = X_WT.x_m - scene_.convex()[k].centre_W_m;
  add_candidate(k, {ContactKind::vertex_face, apart.normalized()}, X_WT, -kInfinity);
}

void SceneContacts::add_face_candidates(std::uint32_t k, const Frame& X_WT) noexcept {
  for (const auto& face : scene_.convex()[k].body.faces)
    add_candidate(k, {ContactKind::vertex_face, face.n}, X_WT, -kInfinity);
  for (const auto& face : scene_.tool().hull.faces)
    add_candidate(k, {ContactKind::face_vertex, Vector3d::UnitZ(), -face.n}, X_WT, -kInfinity);
}

/// Edge pairs on the boundary of the set of colliding translations: the common normal counts if each edge is
/// the farthest part of its body along it.
void SceneContacts::add_edge_pair_candidate(std::uint32_t k, const Frame& X_WT, const ConvexBody::Edge& a,
                                            const ConvexBody::Edge& b, double least_separation_m) noexcept {
  const Vector3d N = (X_WT.R * a.d).cross(b.d);
  if (!(N.squaredNorm() > kParallel * kParallel)) return;
  for (const double sign : {1.0, -1.0}) {
    const Vector3d n_W = sign * N;
    if (!touches_along(b, n_W) || !touches_along(a, X_WT.R.transpose() * -n_W)) continue;
    add_candidate(k, {ContactKind::edge_edge, n_W, a.d, sign * b.d}, X_WT, least_separation_m);
  }
}

void SceneContacts::add_edge_pair_candidates(std::uint32_t k, const Frame& X_WT) noexcept {
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;
  if (tool.edges.size() * obstacle.edges.size() > kMaxEdgePairs) return;
  for (const auto& a : tool.edges)
    for (const auto& b : obstacle.edges) add_edge_pair_candidate(k, X_WT, a, b, -kInfinity);
}

// METHOD (29). The widest gap between two separate bodies is a least-distance problem, solved by constraint
// generation: min |w|^2  s.t.  w . (p_a - p_b) >= 1 for all pairs,  n = w/|w|, and the gap is 1/|w|.
void SceneContacts::add_widest_gap_candidate(std::uint32_t k, const Frame& X_WT) noexcept {
  using Status = LeastDistance<3, 64>::Status;
  constexpr std::size_t kPairs = 64;
  constexpr double kGoodEnough = 0.999;
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;
  const double unit_m = scene_.tool_radius_m();
  SeparatingPlane plane = planes_[k];
  plane.n_W = normal_of(plane, X_WT).n_W;
  plane.kind = ContactKind::vertex_face;
  widest_gap_.clear();
  for (std::size_t pair = 0; pair < kPairs; ++pair) {
    const PlaneSeparation at = plane_separation(k, {plane.n_W, false}, X_WT);
    const double promised_m = widest_gap_.count() == 0 ? kInfinity : unit_m / widest_gap_.z().norm();
    if (at.separation_m > 0.0 && at.separation_m >= kGoodEnough * promised_m) break;
    const Vector3d apart =
        X_WT * tool.vertices_T_m[at.nearest.tool_vertex] - obstacle.vertices_T_m[at.nearest.obstacle_vertex];
    if (!(apart.squaredNorm() > 0.0)) return;
    widest_gap_.add(apart / unit_m, 1.0);
    if (widest_gap_.solve(Vector3d::Zero(), 1e-12) != Status::optimal) return;  // the bodies overlap
    plane.n_W = widest_gap_.z().normalized();
  }
  add_candidate(k, plane, X_WT, 0.0);
}

void SceneContacts::sort_candidates() noexcept {
  std::sort(candidates_.begin(), candidates_.end(),
            [](const PlaneCandidate& x, const PlaneCandidate& y) { return x.separation_m > y.separation_m; });
}

std::size_t SceneContacts::survey_planes(const Pose& pose) noexcept {
  const Frame X_WT(pose);
  survey_candidates_.clear();
  for (std::uint32_t k = 0; k < planes_.size(); ++k) {
    candidates_.clear();
    if (out_of_reach(k, X_WT)) {
      add_centre_line_candidate(k, X_WT);
    } else {
      add_face_candidates(k, X_WT);
      add_edge_pair_candidates(k, X_WT);
      add_widest_gap_candidate(k, X_WT);
    }
    if (candidates_.empty()) continue;
    sort_candidates();
    hold_alternative(0);
    if (candidates_[0].separation_m >= 0.0) continue;  // one plane suffices for bodies that do not overlap
    const std::size_t room = kMaxSurveyPlanes - survey_candidates_.size();
    survey_candidates_.insert(
        survey_candidates_.end(), candidates_.begin(),
        candidates_.begin() + static_cast<std::ptrdiff_t>(std::min(room, candidates_.size())));
  }
  survey_best_ = planes_;
  estimate_survey(X_WT);
  return survey_candidates_.size();
}

// For small rotations, with a the deepest vertex of the tool from its centre of mass:
//
//   estimate = m depth^2 / (1 + m c' H^-1 c),    c = a x n
void SceneContacts::estimate_survey(const Frame& X_WT) noexcept {
  const Inertia& M = scene_.tool().solid.inertia;
  const Matrix3d H_inverse = M.H_kg_m2.inverse();
  for (PlaneCandidate& candidate : survey_candidates_) {
    const Vector3d n_T = X_WT.R.transpose() * candidate.plane.n_W;
    const Vector3d c = scene_.tool().hull.vertices_T_m[candidate.nearest.tool_vertex].cross(n_T);
    const double depth_m = candidate.separation_m;
    candidate.estimate = M.mass_kg * depth_m * depth_m / (1.0 + M.mass_kg * c.dot(H_inverse * c));
  }
  std::sort(survey_candidates_.begin(), survey_candidates_.end(),
            [](const PlaneCandidate& x, const PlaneCandidate& y) { return x.estimate < y.estimate; });
}

void SceneContacts::hold_survey_plane(std::size_t i) noexcept {
  planes_ = survey_best_;
  planes_[survey_candidates_[i].obstacle] = survey_candidates_[i].plane;
}

void SceneContacts::fix_planes_to_world(const Pose& pose) noexcept {
  const Frame X_WT(pose);
  for (std::uint32_t k = 0; k < planes_.size(); ++k) {
    planes_[k].n_W = normal_of(planes_[k], X_WT).n_W;
    planes_[k].kind = ContactKind::vertex_face;
  }
}

/// Collects the vertices of a body that touch a plane with this outward normal. `farthest` is one of them.
void SceneContacts::collect_touching(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
                                     std::vector<std::uint32_t>& out) const noexcept {
  out.clear();
  const double least = normal.dot(body.vertices_T_m[farthest]) - kTouchDistance * scene_.tool_radius_m();
  body.visit_above(
      normal, [&] { return least; },
      [&](std::uint32_t v, double height) {
        if (height >= least) out.push_back(v);
      });
}

/// Adds the planes of the features that touch the held plane, and the plane of the widest gap.
void SceneContacts::add_touching_candidates(std::uint32_t k, const PlaneSeparation& held,
                                            const Frame& X_WT) noexcept {
  const ConvexBody& tool = scene_.tool().hull;
  const ConvexBody& obstacle = scene_.convex()[k].body;
  const double touching_m = kTouchDistance * scene_.tool_radius_m();
  collect_touching(tool, X_WT.R.transpose() * -held.n_W, held.nearest.tool_vertex, touching_vertices_);
  collect_touching(obstacle, held.n_W, held.nearest.obstacle_vertex, obstacle_touching_vertices_);
  for (const std::uint32_t v : obstacle_touching_vertices_)
    for (const std::uint32_t f : obstacle.faces_of(v))
      add_candidate(k, {ContactKind::vertex_face, obstacle.faces[f].n}, X_WT, -touching_m);
  for (const std::uint32_t v : touching_vertices_)
    for (const std::uint32_t f : tool.faces_of(v))
      add_candidate(k, {ContactKind::face_vertex, held.n_W, -tool.faces[f].n}, X_WT, -touching_m);
  for (const std::uint32_t v : touching_vertices_)
    for (const std::uint32_t a : tool.edges_of(v))
      for (const std::uint32_t w : obstacle_touching_vertices_)
        for (const std::uint32_t b : obstacle.edges_of(w))
          add_edge_pair_candidate(k, X_WT, tool.edges[a], obstacle.edges[b], -touching_m);
  const bool apart =
      std::any_of(candidates_.begin(), candidates_.end(), [&](const PlaneCandidate& candidate) {
        return candidate.obstacle == k && candidate.separation_m > touching_m;
      });
  if (!apart) add_widest_gap_candidate(k, X_WT);
}

std::size_t SceneContacts::find_alternative_planes(const Pose& pose) noexcept {
  const Frame X_WT(pose);
  candidates_.clear();
  const double touching_m = kTouchDistance * scene_.tool_radius_m();
  for (std::uint32_t k = 0; k < planes_.size(); ++k) {
    if (out_of_reach(k, X_WT)) continue;
    const PlaneSeparation held = plane_separation(k, normal_of(planes_[k], X_WT), X_WT);
    if (held.separation_m > touching_m) continue;
    add_touching_candidates(k, held, X_WT);
    const auto same = [&](const PlaneCandidate& candidate) {
      return candidate.obstacle == k && same_plane(candidate.plane, planes_[k]);
    };
    candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), same), candidates_.end());
  }
  sort_candidates();
  return candidates_.size();
}

}  // namespace wrenchd
