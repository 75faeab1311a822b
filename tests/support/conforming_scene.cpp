// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/conforming_scene.hpp"

#include <chrono>
#include <fstream>

#include "collision/meshes/make_mesh.hpp"
#include "tests/support/conforming_mesh.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {
namespace {

constexpr double kMetresPerMillimetre = 0.001;
constexpr double kToolMass_kg = 0.2;  ///< that of the shipped scene

Pose X_FC(const ConformingCase& of) {
  return {file_rotation(of), Vector3d::Zero()};
}

}  // namespace

TriangleMesh mesh_in_file(const ConformingCase& of, const TriangleMesh& mesh) {
  TriangleMesh out = of.rotated ? rotated(mesh, file_rotation(of)) : mesh;
  if (of.in_float)
    for (Vector3d& p : out.vertices_m)
      for (double& x : p) x = kMetresPerMillimetre * static_cast<double>(static_cast<float>(1000.0 * x));
  return out;
}

ConformingScene load_scene(const ConformingCase& of, const MeshesOfCase& meshes, MeshLoader& loader,
                           double surface_tolerance_m, const ObstacleMotion& motion) {
  const TemporaryDirectory directory;
  const auto write = [&](const std::string& name, const TriangleMesh& mesh) {
    const std::filesystem::path file = directory.path() / (name + (of.in_float ? ".stl" : ".off"));
    std::ofstream out(file, std::ios::binary);
    of.in_float ? write_binary_stl(out, mesh) : write_off(out, mesh);
    return file;
  };
  const double scale = of.in_float ? kMetresPerMillimetre : 1.0;
  TriangleMesh tool_F = mesh_in_file(of, meshes.tool), obstacle_F = mesh_in_file(of, meshes.obstacle);
  const Pose X_WF = inverse(X_FC(of));
  SceneSettings settings;
  settings.surface_tolerance_m = surface_tolerance_m;
  settings.tool.mesh = write("tool", tool_F);
  settings.tool.scale = scale;
  settings.tool.mass_kg = kToolMass_kg;
  settings.meshes.push_back(
      {"obstacle", write("obstacle", obstacle_F), scale, X_WF, BodyKind::solid, motion});
  const auto begin = std::chrono::steady_clock::now();
  ConformingScene loaded = {Scene(settings, loader), {}, X_WF, std::move(tool_F), std::move(obstacle_F)};
  loaded.load_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  loaded.X_TC = inverse(loaded.X_FT()) * X_FC(of);
  return loaded;
}

ConformingScene load_coarse_scene(const ConformingCase& of) {
  ConformingCase plain = of;
  plain.in_float = plain.rotated = false;
  MeshLoader loader;
  return load_scene(plain, coarse_meshes(of), loader, 0.0);
}

std::vector<Pose> body_poses(const ConformingScene& scene, const std::vector<Pose>& X_WC) {
  std::vector<Pose> X_WP;
  const Pose X_CT = inverse(scene.X_TC);
  for (const Pose& X : X_WC) X_WP.push_back(X * X_CT);
  return X_WP;
}

}  // namespace wrenchd::test
