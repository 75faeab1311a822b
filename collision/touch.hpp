// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "collision/scene.hpp"
#include "core/contact.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// Kinds of features and the meaning of their numbers. Mesh features refer to the mesh as loaded, hull
/// features to its convex hull.
enum class FeatureKind : std::uint8_t {
  none,
  vertex,       ///< first: vertex number
  edge,         ///< first and second: vertex numbers
  face,         ///< first: triangle number; coplanar adjacent triangles share the number of one of them
  hull_vertex,  ///< first: vertex number in the hull
  hull_edge,
  hull_face,
  plane,  ///< the plane of a half-space
};
inline constexpr std::size_t kFeatureKindCount = 8;

/// Returns the name of a kind, for example "hull vertex". RT-safe.
const char* name(FeatureKind kind) noexcept;

/// A vertex, edge or face of one body.
struct Feature {
  FeatureKind kind = FeatureKind::none;
  std::uint32_t first = 0;
  std::uint32_t second = 0;  ///< second vertex of an edge; 0 for all other kinds
};

/// Returns "vertex 12", "edge 3-7" or "plane". Not RT-safe: allocates.
std::string text(const Feature& feature);

/// A contact for display and recording, in plain numbers.
struct Touch {
  std::array<double, 3> point_W_m{};  ///< contact point in W [m]
  std::array<double, 3> normal_W{};   ///< unit normal from the obstacle to the tool, in W
  double multiplier_kg_m = 0.0;       ///< d T / d gap: METHOD (35)
  double load_fraction = 0.0;         ///< multiplier as a fraction of the sum over all contacts, 0 to 1
  std::uint32_t obstacle = 0;         ///< obstacle number in the scene; free bodies count after the obstacles
  std::uint32_t tool_first = 0;       ///< Feature::first of the tool's feature
  std::uint32_t tool_second = 0;      ///< Feature::second of the tool's feature
  std::uint32_t obstacle_first = 0;   ///< Feature::first of the obstacle's feature
  std::uint32_t obstacle_second = 0;  ///< Feature::second of the obstacle's feature
  std::uint8_t contact_kind = 0;      ///< ContactKind
  std::uint8_t tool_feature_kind = 0;  ///< FeatureKind of the tool's feature
  std::uint8_t obstacle_feature_kind = 0;
  std::uint8_t padding = 0;
};

/// Maximum number of reported contacts. If there are more, those with the largest multipliers are reported.
/// An optimum of 6 unknowns has few loaded contacts.
inline constexpr std::size_t kMaxTouches = 16;
using Touches = StaticVector<Touch, kMaxTouches>;

/// Returns the contacts of an answer, the largest multiplier first. of_meshes: true if contacts with mesh
/// obstacles number mesh features, as those of a proxy; false if they number hull features. RT-safe.
Touches touches(const Projection& projection, const Scene& scene, bool of_meshes) noexcept;

/// Returns the features that a contact joins. RT-safe.
Feature tool_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept;
Feature obstacle_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept;

/// Returns the name of an obstacle or body in the scene, or "obstacle 3" if it has none. Not RT-safe:
/// allocates.
std::string obstacle_name(const Scene& scene, std::uint32_t number);

}  // namespace wrenchd
