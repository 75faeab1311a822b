// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>

#include "collision/bodies/shared_world.hpp"
#include "collision/scene.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

/// The scene as one of two hands sees it: its own tool, the obstacles, the free bodies, and as the last body
/// the tool of the other hand.
struct HandScene {
  std::shared_ptr<const Scene> scene;  ///< null: the hand is the only one, and its scene is not built yet
  SharedTool tool;
};

/// Returns the scene with a second tool, which is that of the scene, as the last body. Not RT-safe:
/// allocates.
std::shared_ptr<const Scene> with_equal_tool(const Scene& scene, const RenderingSettings& rendering);

/// Loads the scene of two hands, which differs in the tool only, and builds the world that they share. Throws
/// MeshError; std::runtime_error if the scene has too many bodies. Not RT-safe: reads meshes, may take
/// seconds.
std::array<HandScene, 2> make_hand_scenes(const RunConfig& first, const RunConfig& second,
                                          MeshLoader& loader);

}  // namespace wrenchd
