// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/sweep_crossings.hpp"

#include <algorithm>
#include <tuple>

namespace wrenchd {
namespace {

constexpr std::size_t kMaxCrossings = 512;
/// Crossings with similar normals count as one within this distance, as a multiple of the path length.
constexpr double kDuplicateDistance = 4.0;
constexpr double kSameNormal = 0.9;  // cosine of the angle between the normals

}  // namespace

Contact vertex_face_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t vertex,
                            std::uint32_t triangle, const MeshSurface::Plane& plane) noexcept {
  Contact contact;
  contact.kind = ContactKind::vertex_face;
  contact.p_TCa_m = tool.vertices_m()[vertex];
  contact.n_W = view.X_WO.R * plane.normal;
  contact.p_WCb_m = view.X_WO * (plane.offset_m * plane.normal);
  contact.offset_m = plane.offset_m + contact.n_W.dot(view.X_WO.x_m);
  contact.tool_feature = vertex;
  contact.obstacle_feature = view.obstacle->mesh->surface.planar_region(triangle);
  contact.obstacle = view.number;
  return contact;
}

Contact face_vertex_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t triangle,
                            const MeshSurface::Plane& plane, std::uint32_t vertex) noexcept {
  Contact contact;
  contact.kind = ContactKind::face_vertex;
  contact.d_T = -plane.normal;
  contact.p_TCa_m = plane.offset_m * plane.normal;
  contact.p_WCb_m = view.X_WO * view.obstacle->mesh->surface.vertices_m()[vertex];
  contact.n_W = view.X_WO.R * (view.X_OT_end.R * contact.d_T);
  contact.tool_feature = tool.planar_region(triangle);
  contact.obstacle_feature = vertex;
  contact.obstacle = view.number;
  return contact;
}

Contact edge_edge_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t edge_a,
                          std::uint32_t edge_b, double sign, const Vector3d& n_O) noexcept {
  const MeshSurface& surface = view.obstacle->mesh->surface;
  const MeshSurface::Edge& ea = tool.convex_edges()[edge_a];
  const MeshSurface::Edge& eb = surface.convex_edges()[edge_b];
  const Vector3d& b0 = surface.vertices_m()[eb.vertices[0]];
  const Vector3d db = surface.vertices_m()[eb.vertices[1]] - b0;
  Contact contact;
  contact.kind = ContactKind::edge_edge;
  contact.p_TCa_m = tool.vertices_m()[ea.vertices[0]];
  contact.d_T = (tool.vertices_m()[ea.vertices[1]] - contact.p_TCa_m).normalized();
  contact.p_WCb_m = view.X_WO * b0;
  contact.d_W = view.X_WO.R * (db * (sign / db.norm()));
  contact.n_W = view.X_WO.R * n_O;
  contact.tool_feature = edge_a;
  contact.obstacle_feature = edge_b;
  contact.obstacle = view.number;
  return contact;
}

OutwardPath outward_path(const MeshSurface& obstacle, const MeshSurface::Edge& edge_b,
                         const MeshSurface& tool, const MeshSurface::Edge& edge_a, const ObstacleView& view,
                         const Vector3d& from_b_at_start) noexcept {
  if (!edge_b.is_border()) {
    const Vector3d out = obstacle.outward(edge_b);
    return {out, out};
  }
  if (edge_a.is_border()) return {from_b_at_start, from_b_at_start};
  const Vector3d into = -tool.outward(edge_a);
  return {view.X_OT_start.R * into, view.X_OT_end.R * into};
}

CrossingList::CrossingList() {
  crossings_.reserve(kMaxCrossings);
}

void CrossingList::add(double path_fraction, const Vector3d& point_W_m, const Contact& contact) noexcept {
  if (crossings_.size() < crossings_.capacity()) {
    crossings_.push_back({path_fraction, point_W_m, contact});
    return;
  }
  const auto last = std::max_element(
      crossings_.begin(), crossings_.end(),
      [](const Crossing& a, const Crossing& b) { return a.path_fraction < b.path_fraction; });
  if (path_fraction < last->path_fraction) *last = {path_fraction, point_W_m, contact};
}

void CrossingList::select_first(double displacement_bound_m, double tool_radius_m,
                                StaticVector<Contact, SweepQuery::kMaxContacts>& contacts) noexcept {
  if (crossings_.empty()) return;
  std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& a, const Crossing& b) {
    if (a.path_fraction != b.path_fraction) return a.path_fraction < b.path_fraction;
    return std::tie(a.contact.tool_feature, a.contact.obstacle_feature, a.contact.kind, a.contact.obstacle) <
           std::tie(b.contact.tool_feature, b.contact.obstacle_feature, b.contact.kind, b.contact.obstacle);
  });
  const double close_m = std::min(kDuplicateDistance * displacement_bound_m, 0.25 * tool_radius_m);
  StaticVector<Vector3d, SweepQuery::kMaxContacts> points;
  for (const Crossing& crossing : crossings_) {
    bool duplicate = false;
    for (std::size_t i = 0; i < points.size() && !duplicate; ++i)
      duplicate = (points[i] - crossing.point_W_m).squaredNorm() < close_m * close_m &&
                  contacts[i].n_W.dot(crossing.contact.n_W) > kSameNormal;
    if (duplicate || !contacts.add(crossing.contact)) continue;
    points.add(crossing.point_W_m);
  }
}

}  // namespace wrenchd
