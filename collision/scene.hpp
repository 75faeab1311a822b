// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "collision/tool_body.hpp"
#include "core/contact.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// The tool and the obstacles it may touch. Built once, then only read.
class Scene final : public ContactSource {
 public:
  /// Throws MeshError where the tool's mesh cannot be used.
  explicit Scene(const SceneSettings& settings);
  Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces);

  const ToolBody& tool() const noexcept { return tool_; }
  const std::vector<HalfSpaceSettings>& half_spaces() const noexcept { return half_spaces_; }

  /// The deepest vertices of the tool's hull in each half-space, at most kPerObstacle of each. X_WT: tool's
  /// body frame.
  std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                           ContactSet& contacts) const noexcept override;

  /// The least gap of the tool to any obstacle [m]: negative where they overlap, infinite in an empty scene.
  /// RT safe.
  double least_gap_m(const Pose& X_WT) const noexcept;

 private:
  /// How many new contacts one obstacle contributes to one round of constraint generation: three hold a face,
  /// and one more tells which way it would tip.
  static constexpr std::size_t kPerObstacle = 4;

  ToolBody tool_;
  std::vector<HalfSpaceSettings> half_spaces_;
};

}  // namespace wrenchd
