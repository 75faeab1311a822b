// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#include "collision/meshes/mesh_surface.hpp"
#include "collision/meshes/triangle_bvh.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The surface of a body of any shape and the BVH over its triangles.
struct MeshBvh {
  MeshBvh() = default;  ///< empty; the mesh cache fills it through visit_members()
  explicit MeshBvh(TriangleMesh mesh, MeshSurface::Kind kind = MeshSurface::Kind::solid)
      : surface(std::move(mesh), kind), bvh(surface) {}

  MeshSurface surface;
  TriangleBvh bvh;
};

}  // namespace wrenchd
