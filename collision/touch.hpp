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

/// What a feature is part of, and what its numbers count. Mesh features are those of the mesh as it was
/// loaded; hull features those of its convex hull.
enum class FeatureKind : std::uint8_t {
  none,
  vertex,       ///< first: the vertex
  edge,         ///< first and second: its vertices
  face,         ///< first: a triangle; those in one plane, side by side, go by one of them
  hull_vertex,  ///< as above, of the hull
  hull_edge,
  hull_face,
  plane,  ///< the one plane of a half-space
};
inline constexpr std::size_t kFeatureKindCount = 8;

/// "hull vertex"
const char* name(FeatureKind kind) noexcept;

/// A vertex, edge or face of one body.
struct Feature {
  FeatureKind kind = FeatureKind::none;
  std::uint32_t first = 0;
  std::uint32_t second = 0;  ///< of an edge; 0 for all others
};

/// "vertex 12", "edge 3-7", "plane". Not RT safe.
std::string text(const Feature& feature);

/// A contact as it is shown to whoever looks, in plain numbers.
struct Touch {
  std::array<double, 3> point_W_m{};   ///< where the two touch, in W
  std::array<double, 3> normal_W{};    ///< unit, from the obstacle to the tool
  double multiplier_kg_m = 0.0;        ///< d T / d gap of Eq. (8): what the contact carries
  double load_fraction = 0.0;          ///< Multiplier divided by the sum of all multipliers, 0 to 1.
  std::uint32_t obstacle = 0;          ///< number in the scene
  std::uint32_t tool_first = 0;        ///< of the tool's feature, as in Feature
  std::uint32_t tool_second = 0;       ///< likewise
  std::uint32_t obstacle_first = 0;    ///< of the obstacle's
  std::uint32_t obstacle_second = 0;   ///< likewise
  std::uint8_t contact_kind = 0;       ///< ContactKind
  std::uint8_t tool_feature_kind = 0;  ///< FeatureKind
  std::uint8_t obstacle_feature_kind = 0;
  std::uint8_t padding = 0;
};

/// Of many contacts those that carry most are told; an optimum of 6 unknowns has few that carry.
inline constexpr std::size_t kMaxTouches = 16;
using Touches = StaticVector<Touch, kMaxTouches>;

/// The contacts that hold an answer, those that carry most first. of_meshes: whether contacts with mesh
/// obstacles number the features of the meshes, as a proxy's do, or those of their hulls. RT safe.
Touches touches(const Projection& projection, const Scene& scene, bool of_meshes) noexcept;

/// The features that a contact joins. RT safe.
Feature tool_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept;
Feature obstacle_feature(const Contact& contact, const Scene& scene, bool of_meshes) noexcept;

/// The name of an obstacle as the scene gives it; "obstacle 3" where it gives none. Not RT safe.
std::string obstacle_name(const Scene& scene, std::uint32_t number);

}  // namespace wrenchd
