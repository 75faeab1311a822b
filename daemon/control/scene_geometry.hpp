// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "collision/scene.hpp"
#include "config/settings.hpp"
#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// What the bodies of a scene look like, in memory that other processes may map: sealed, so that whoever has
/// the descriptor can only read it. Each mesh is there once, however many obstacles it is.
///
///   vertices    three floats each [m], in the mesh's own frame (O; T for the tool's)
///   triangles   three vertex numbers of 32 bits each, counter-clockwise seen from outside
///
/// Not RT safe; a million triangles take some tens of milliseconds.
class SceneGeometry {
 public:
  /// Throws std::system_error where the kernel gives no such memory.
  explicit SceneGeometry(std::shared_ptr<const Scene> scene);
  ~SceneGeometry();
  SceneGeometry(const SceneGeometry&) = delete;
  SceneGeometry& operator=(const SceneGeometry&) = delete;

  /// Whether another scene has the same meshes, wherever its obstacles stand: then these shapes are its too.
  bool matches(const Scene& scene) const;
  /// Which mesh is whose, where it stands and how it moves: {bytes, meshes, tool, obstacles}. The scene has
  /// to be one that fits(). Obstacles are in the order of their numbers.
  Json description(const Scene& scene) const;

  int descriptor() const noexcept { return descriptor_; }  ///< stays open for as long as this is
  std::span<const std::byte> bytes() const noexcept { return {memory_, bytes_}; }

 private:
  struct MeshLayout {
    std::size_t vertices, vertices_offset, triangles, triangles_offset;
  };
  std::size_t mesh_number(const MeshBvh* mesh) const;

  std::shared_ptr<const Scene> scene_;  ///< keeps the meshes, by which others are told to be the same
  std::vector<const MeshBvh*> meshes_;
  std::vector<MeshLayout> layouts_;  ///< of the tool, then of each of meshes_
  std::size_t bytes_ = 0;
  int descriptor_ = -1;
  std::byte* memory_ = nullptr;
};

/// {eye_m, target_m}, or null where nobody has said from where a scene is seen best.
Json view_json(const ViewSettings& view);

/// A pose as records have it: x y z [m], qx qy qz qw.
Json pose_json(const Pose& X);

}  // namespace wrenchd
