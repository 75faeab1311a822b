// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/touch.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr std::array<const char*, kFeatureKindCount> kNames = {
    "none", "vertex", "edge", "face", "hull vertex", "hull edge", "hull face", "plane"};

/// Directions are equal within this tolerance [1 - cosine].
constexpr double kSameDirection = 1e-9;

/// Returns the hull edge at a vertex that is parallel to d; the vertex if there is none.
Feature hull_edge(const ConvexBody& hull, std::uint32_t vertex, const Vector3d& d) noexcept {
  for (const std::uint32_t e : hull.edges_of(vertex)) {
    const ConvexBody::Edge& edge = hull.edges[e];
    if (std::abs(edge.d.dot(d)) >= 1.0 - kSameDirection)
      return {FeatureKind::hull_edge, std::min(edge.from, edge.to), std::max(edge.from, edge.to)};
  }
  return {FeatureKind::hull_vertex, vertex, 0};
}

/// Returns the hull face at a vertex with outward normal n. If the plane touches the hull in that vertex
/// only, returns the vertex.
Feature hull_face(const ConvexBody& hull, std::uint32_t vertex, const Vector3d& n) noexcept {
  for (const std::uint32_t f : hull.faces_of(vertex))
    if (hull.faces[f].n.dot(n) >= 1.0 - kSameDirection) return {FeatureKind::hull_face, f, 0};
  return {FeatureKind::hull_vertex, vertex, 0};
}

Feature mesh_edge(const MeshBvh& mesh, std::uint32_t edge) noexcept {
  const auto& vertices = mesh.surface.convex_edges()[edge].vertices;
  const std::uint32_t a = mesh.loaded_vertex(vertices[0]), b = mesh.loaded_vertex(vertices[1]);
  return {FeatureKind::edge, std::min(a, b), std::max(a, b)};
}

/// Returns the contact point. A plane along two edges may touch a hull in a vertex that is no end of its
/// edge; the vertex is then the contact point.
Vector3d point_W(const Contact& contact, FeatureKind tool, FeatureKind obstacle, const Pose& X_WQ) noexcept {
  if (contact.kind != ContactKind::edge_edge) return contact_point_W(contact, X_WQ);
  if (tool == FeatureKind::hull_vertex) return X_WQ * contact.p_TCa_m;
  if (obstacle == FeatureKind::hull_vertex) return contact.p_WCb_m;
  return contact_point_W(contact, X_WQ);
}

std::array<double, 3> coordinates(const Vector3d& v) noexcept {
  return {v.x(), v.y(), v.z()};
}

std::string name_or_number(const std::string& name, std::uint32_t number) {
  return name.empty() ? "obstacle " + std::to_string(number) : name;
}

}  // namespace

const char* name(FeatureKind kind) noexcept {
  const auto i = static_cast<std::size_t>(kind);
  return i < kNames.size() ? kNames[i] : "unknown";
}

std::string text(const Feature& feature) {
  const std::string kind = name(feature.kind);
  switch (feature.kind) {
    case FeatureKind::none:
    case FeatureKind::plane:
      return kind;
    case FeatureKind::edge:
    case FeatureKind::hull_edge:
      return kind + " " + std::to_string(feature.first) + "-" + std::to_string(feature.second);
    default:
      return kind + " " + std::to_string(feature.first);
  }
}

Feature tool_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept {
  const bool mesh = of_meshes && contact.obstacle >= scene.first_mesh();
  switch (contact.kind) {
    case ContactKind::vertex_face:
      if (mesh) return {FeatureKind::vertex, scene.tool_mesh()->loaded_vertex(contact.tool_feature), 0};
      return {FeatureKind::hull_vertex, contact.tool_feature, 0};
    case ContactKind::face_vertex:
      if (mesh) return {FeatureKind::face, scene.tool_mesh()->loaded_triangle(contact.tool_feature), 0};
      return hull_face(scene.tool().hull, contact.tool_feature, -contact.d_T);
    case ContactKind::edge_edge:
      break;
  }
  return mesh ? mesh_edge(*scene.tool_mesh(), contact.tool_feature)
              : hull_edge(scene.tool().hull, contact.tool_feature, contact.d_T);
}

Feature obstacle_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept {
  if (contact.obstacle < scene.half_spaces().size()) return {FeatureKind::plane, 0, 0};
  const std::size_t k = contact.obstacle - scene.half_spaces().size();
  const std::uint32_t feature = contact.obstacle_feature;
  if (of_meshes && contact.obstacle >= scene.first_mesh()) {
    const MeshBvh& mesh = *scene.meshes()[k].mesh;
    if (contact.kind == ContactKind::vertex_face)
      return {FeatureKind::face, mesh.loaded_triangle(feature), 0};
    if (contact.kind == ContactKind::face_vertex)
      return {FeatureKind::vertex, mesh.loaded_vertex(feature), 0};
    return mesh_edge(mesh, feature);
  }
  const ConvexBody& hull = scene.convex()[k].body;
  if (contact.kind == ContactKind::vertex_face) return hull_face(hull, feature, contact.n_W);
  if (contact.kind == ContactKind::face_vertex) return {FeatureKind::hull_vertex, feature, 0};
  return hull_edge(hull, feature, contact.d_W);
}

Touches touches(const Projection& projection, const Scene& scene, bool of_meshes) noexcept {
  const auto& active = projection.active;
  std::array<std::uint8_t, ContactSet::kCapacity> order{};  // indices sorted by multiplier, largest first
  double sum = 0.0;
  for (std::size_t i = 0; i < active.size(); ++i) {
    sum += active[i].multiplier;
    order[i] = static_cast<std::uint8_t>(i);
  }
  const auto position = [&](std::size_t i) { return order.begin() + static_cast<std::ptrdiff_t>(i); };
  const std::size_t count = std::min(kMaxTouches, active.size());
  std::partial_sort(order.begin(), position(count), position(active.size()),
                    [&](std::uint8_t a, std::uint8_t b) {
                      const double difference = active[a].multiplier - active[b].multiplier;
                      return difference != 0.0 ? difference > 0.0 : a < b;
                    });
  Touches out;
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [contact, multiplier] = active[order[i]];
    const Feature tool = tool_feature(contact, scene, of_meshes);
    const Feature obstacle = obstacle_feature(contact, scene, of_meshes);
    Touch touch;
    touch.point_W_m = coordinates(point_W(contact, tool.kind, obstacle.kind, projection.X_WQ));
    touch.normal_W = coordinates(normal_W(contact, projection.X_WQ));
    touch.multiplier_kg_m = multiplier;
    touch.load_fraction = sum > 0.0 ? multiplier / sum : 0.0;
    touch.obstacle = contact.obstacle;
    touch.tool_first = tool.first;
    touch.tool_second = tool.second;
    touch.obstacle_first = obstacle.first;
    touch.obstacle_second = obstacle.second;
    touch.contact_kind = static_cast<std::uint8_t>(contact.kind);
    touch.tool_feature_kind = static_cast<std::uint8_t>(tool.kind);
    touch.obstacle_feature_kind = static_cast<std::uint8_t>(obstacle.kind);
    out.add(touch);
  }
  return out;
}

std::string obstacle_name(const Scene& scene, std::uint32_t number) {
  const std::size_t half_spaces = scene.half_spaces().size();
  if (number < half_spaces) return name_or_number(scene.half_spaces()[number].name, number);
  const std::size_t k = number - half_spaces;
  if (k < scene.meshes().size()) return name_or_number(scene.meshes()[k].name, number);
  if (k < scene.convex().size()) return name_or_number(scene.convex()[k].name, number);
  const std::size_t body = number - scene.obstacle_count();
  if (body < scene.bodies().size()) return name_or_number(scene.bodies()[body].name, number);
  return name_or_number({}, number);
}

}  // namespace wrenchd
