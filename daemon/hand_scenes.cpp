// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/hand_scenes.hpp"

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/scene_settings.hpp"

namespace wrenchd {
namespace {

/// The tool of a hand as the other hand sees it. It is far away until it enters the world.
FreeBody as_body(const Scene& scene, const RenderingSettings& rendering) {
  FreeBody body;
  body.name = "tool of the other hand";
  body.body = scene.tool();
  body.motion.X_WB.translation_m.z() = -SharedWorld::kFarBelow_m;
  body.friction = rendering.friction.dynamic_coefficient;
  body.mesh = scene.shared_tool_mesh();
  body.of_hand = true;
  return body;
}

std::shared_ptr<const Scene> with_tool(const Scene& scene, FreeBody other) {
  std::vector<FreeBody> bodies = scene.bodies();
  bodies.push_back(std::move(other));
  return std::make_shared<const Scene>(scene, std::move(bodies), scene.gravity_W_m_per_s2());
}

}  // namespace

std::shared_ptr<const Scene> with_equal_tool(const Scene& scene, const RenderingSettings& rendering) {
  return with_tool(scene, as_body(scene, rendering));
}

std::array<HandScene, 2> make_hand_scenes(const RunConfig& first, const RunConfig& second,
                                          MeshLoader& loader) {
  constexpr std::size_t kMost = SceneSettings::kMaxBodies - 1;
  if (first.scene.bodies.size() > kMost)
    throw std::runtime_error(first.scene.file.string() + ": with two hands a scene has at most " +
                             std::to_string(kMost) +
                             " [[body]] tables, because the other tool counts as one");
  const Scene a(first.scene, loader), b(second.scene, loader);
  HandScene one, other;
  one.scene = with_tool(a, as_body(b, second.settings.rendering));
  other.scene = with_tool(b, as_body(a, first.settings.rendering));
  const RenderingSettings& rendering = first.settings.rendering;
  const auto world =
      std::make_shared<SharedWorld>(*one.scene, rendering.friction.dynamic_coefficient, rendering.grasp);
  one.tool = {world, 0};
  other.tool = {world, 1};
  return {one, other};
}

}  // namespace wrenchd
