// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/scene_cost.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

namespace wrenchd {
namespace {

/// Triangles of each mesh, by file name or name of the generated mesh. A mesh that several bodies use counts
/// once.
using Costs = std::map<std::filesystem::path, std::uint64_t>;

/// Returns the size of a triangle in the most compact file of this format [bytes]: a binary file for STL and
/// PLY, a text for OFF and OBJ with as many vertices as a closed mesh needs.
std::uint64_t bytes_per_triangle(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  if (extension == ".stl") return 50;
  return extension == ".ply" ? 19 : 25;
}

std::uint64_t triangles(const std::filesystem::path& mesh, const std::optional<GeneratedMesh>& generated) {
  if (generated) return generated->triangles;
  std::error_code error;
  const auto bytes = std::filesystem::file_size(mesh, error);
  return error ? 0 : bytes / bytes_per_triangle(mesh);
}

Costs costs(const SceneSettings& scene) {
  Costs all;
  all[scene.tool.mesh] = triangles(scene.tool.mesh, scene.tool.generated);
  for (const MeshObstacleSettings& obstacle : scene.meshes)
    all[obstacle.mesh] = triangles(obstacle.mesh, obstacle.generated);
  for (const BodySettings& body : scene.bodies)
    all[body.shape.mesh] = triangles(body.shape.mesh, body.shape.generated);
  return all;
}

}  // namespace

void check_scene_cost(const SceneSettings& scene, const SceneSettings& present) {
  const Costs known = costs(present);
  std::uint64_t added = 0;
  for (const auto& [mesh, count] : costs(scene))
    if (!known.contains(mesh)) added += count;
  if (added <= kMaxAddedTriangles) return;
  throw std::invalid_argument("the new meshes have about " + std::to_string(added) +
                              " triangles, and a change over the control socket may add at most " +
                              std::to_string(kMaxAddedTriangles) +
                              "; use fewer triangles, or let an administrator name the scene in wrenchd.toml "
                              "and reload");
}

}  // namespace wrenchd
