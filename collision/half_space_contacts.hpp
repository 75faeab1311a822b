// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "collision/scene.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"

namespace wrenchd {

/// The contacts of the tool with the half-spaces of a scene: its hull's vertices, for nothing else of it can
/// meet a plane first. Has no memory of its own. The scene is kept by reference.
class HalfSpaceContacts {
 public:
  explicit HalfSpaceContacts(const Scene& scene) : scene_(scene) {}

  /// As ContactSource has it: the deepest vertices, at most kMaxPerObstacle for each half-space. RT safe.
  void add_violated(const Frame& X_WT, double tolerance_m, ContactSet& contacts) const noexcept;
  void add_touching(const Frame& X_WT, double within_m, ContactSet& contacts) const noexcept;
  bool admits(const Frame& X_WT, double tolerance_m) const noexcept;

  /// How many new contacts one obstacle contributes to one round of constraint generation: three hold a face,
  /// and one more tells which way it would tip.
  static constexpr std::size_t kMaxPerObstacle = 4;

 private:
  /// A half-space seen from the tool: gap of vertex a = n_T . a - below_m.
  struct HalfSpaceInTool {
    Vector3d n_T;
    double offset_m;
  };
  HalfSpaceInTool half_space_in_tool(std::uint32_t k, const Frame& X_WT) const noexcept;
  Contact make_contact(std::uint32_t k, std::uint32_t vertex) const noexcept;

  const Scene& scene_;
};

}  // namespace wrenchd
