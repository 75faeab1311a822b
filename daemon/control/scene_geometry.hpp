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

/// The meshes of a scene in a sealed memory, which other processes map and can only read. A mesh that several
/// obstacles use is stored once.
///
///   vertices    three floats each [m], in the frame of the mesh (O for an obstacle, T for the tool)
///   triangles   three vertex numbers of 32 bits each, counter-clockwise from outside
///
/// Not RT-safe: a million triangles take some tens of milliseconds.
class SceneGeometry {
 public:
  /// Throws std::system_error if the kernel denies the memory.
  explicit SceneGeometry(std::shared_ptr<const Scene> scene);
  ~SceneGeometry();
  SceneGeometry(const SceneGeometry&) = delete;
  SceneGeometry& operator=(const SceneGeometry&) = delete;

  /// Returns true if the scene has the same meshes. The poses of its obstacles may differ.
  bool matches(const Scene& scene) const;
  /// Returns {bytes, meshes, tool, obstacles}: the offsets of each mesh, and for each body its mesh, pose and
  /// motion. Obstacles are in the order of their numbers. Precondition: matches(scene).
  Json description(const Scene& scene) const;

  int descriptor() const noexcept { return descriptor_; }  ///< open while this object lives
  std::span<const std::byte> bytes() const noexcept { return {memory_, bytes_}; }

 private:
  struct MeshLayout {
    std::size_t vertices, vertices_offset, triangles, triangles_offset;
  };
  std::size_t mesh_number(const MeshBvh* mesh) const;

  std::shared_ptr<const Scene> scene_;  ///< owns the meshes, which matches() compares by address
  std::vector<const MeshBvh*> meshes_;
  std::vector<MeshLayout> layouts_;  ///< of the tool, then of each of meshes_
  std::size_t bytes_ = 0;
  int descriptor_ = -1;
  std::byte* memory_ = nullptr;
};

/// Returns {eye_m, target_m}, or null if the configuration has no camera. Not RT-safe: allocates.
Json view_json(const ViewSettings& view);

/// Returns a pose as in tick records: x y z [m], qx qy qz qw. Not RT-safe: allocates.
Json pose_json(const Pose& X);

/// [x, y, z]. Not RT-safe: allocates.
Json json_of(const Vector3d& v);

}  // namespace wrenchd
