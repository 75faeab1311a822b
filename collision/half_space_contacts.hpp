// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "collision/scene.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"

namespace wrenchd {

/// The contacts of the tool with the half-spaces of a scene. Only vertices of the tool's convex hull can
/// touch a plane first, so only they form contacts. The object has no state. It keeps a reference to the
/// scene, which must outlive it. All members are RT-safe.
class HalfSpaceContacts {
 public:
  explicit HalfSpaceContacts(const Scene& scene) : scene_(scene) {}

  /// Same contract as ContactSource: adds the deepest vertices, at most kMaxPerObstacle for each half-space.
  /// X_WT: pose of the tool body frame T in the world W.
  void add_violated(const Frame& X_WT, double tolerance_m, ContactSet& contacts) const noexcept;
  void add_touching(const Frame& X_WT, double within_m, ContactSet& contacts) const noexcept;
  bool admits(const Frame& X_WT, double tolerance_m) const noexcept;

  /// The maximum number of new contacts that one obstacle adds in one round of constraint generation. Three
  /// contacts support a face, and a fourth shows the direction in which the tool would tip.
  static constexpr std::size_t kMaxPerObstacle = 4;

 private:
  /// A half-space in the tool frame T: gap of vertex a = n_T . a - offset_m.
  struct HalfSpaceInTool {
    Vector3d n_T;
    double offset_m;
  };
  HalfSpaceInTool half_space_in_tool(std::uint32_t k, const Frame& X_WT) const noexcept;
  Contact make_contact(std::uint32_t k, std::uint32_t vertex) const noexcept;

  const Scene& scene_;
};

}  // namespace wrenchd
