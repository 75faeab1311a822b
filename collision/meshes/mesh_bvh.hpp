// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "collision/meshes/mesh_simplifier.hpp"
#include "collision/meshes/mesh_surface.hpp"
#include "collision/meshes/triangle_bvh.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The surface of a body of any shape as contacts use it, and the BVH over its triangles. For a solid this
/// may be a simplified mesh that encloses the loaded one (mesh_simplifier.hpp).
struct MeshBvh {
  MeshBvh() = default;  ///< empty; the mesh cache fills it through visit_members()
  explicit MeshBvh(TriangleMesh mesh, MeshSurface::Kind kind = MeshSurface::Kind::solid)
      : surface(std::move(mesh), kind), bvh(surface) {}
  /// Uses another mesh for contacts than the loaded one. loaded_: the mesh that was simplified or smoothed.
  MeshBvh(SimplifiedMesh simplified, TriangleMesh loaded_, MeshSurface::Kind kind = MeshSurface::Kind::solid)
      : surface(std::move(simplified.mesh), kind),
        bvh(surface),
        surface_tolerance_m(simplified.distance_m),
        loaded(std::move(loaded_)),
        source_vertex(std::move(simplified.source_vertex)),
        source_triangle(std::move(simplified.source_triangle)) {}

  /// Returns the mesh as loaded. RT-safe.
  const TriangleMesh& loaded_mesh() const noexcept {
    return loaded.triangles.empty() ? surface.mesh() : loaded;
  }
  /// Returns the number that a vertex or triangle of `surface` has in loaded_mesh(). A vertex that replaces
  /// several others has the number of one of them. RT-safe.
  std::uint32_t loaded_vertex(std::uint32_t vertex) const noexcept {
    return source_vertex.empty() ? vertex : source_vertex[vertex];
  }
  std::uint32_t loaded_triangle(std::uint32_t triangle) const noexcept {
    return source_triangle.empty() ? triangle : source_triangle[triangle];
  }

  /// Calls use(member) for each data member, for the mesh cache (mesh_cache.hpp).
  template <class Use>
  void visit_members(const Use& use) {
    surface.visit_members(use), bvh.visit_members(use);
    use(divides_space), use(surface_tolerance_m), use(loaded.vertices_m), use(loaded.triangles),
        use(source_vertex), use(source_triangle);
  }

  MeshSurface surface;
  TriangleBvh bvh;
  /// True for a closed surface (MeshSurface::is_closed()) of which is known that it does not intersect
  /// itself.
  bool divides_space = false;
  double surface_tolerance_m = 0.0;            ///< largest distance of `surface` from loaded_mesh() [m]
  TriangleMesh loaded;                         ///< empty if `surface` is the mesh as loaded
  std::vector<std::uint32_t> source_vertex;    ///< empty if `surface` is the mesh as loaded
  std::vector<std::uint32_t> source_triangle;  ///< empty if `surface` is the mesh as loaded
};

}  // namespace wrenchd
