// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: collision/meshes/mesh_file.cpp collision/meshes/obj_reader.cpp
// collision/meshes/off_reader.cpp collision/meshes/ply_reader.cpp collision/meshes/stl_reader.cpp
// collision/meshes/mesh_source.cpp collision/meshes/mesh_repair.cpp collision/meshes/mesh_check.cpp
// collision/meshes/half_edges.cpp
#include "tests/fuzz/fuzz_mesh.hpp"

#include <string>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "core/finite.hpp"
#include "tests/fuzz/feed.hpp"

// Reads any bytes as a mesh file. The reader throws MeshError, or the check reports defects, or the mesh has
// finite points and valid indices. The options of the run limit time and memory.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

void check_mesh(const TriangleMesh& mesh) {
  require(!mesh.triangles.empty(), "a valid mesh has triangles");
  for (const Vector3d& v : mesh.vertices_m) require(is_finite(v), "points are finite");
  for (const auto& triangle : mesh.triangles)
    for (const auto corner : triangle)
      require(corner < mesh.vertices_m.size(), "vertex indices are in range");
}

void load(MeshSource source, BodyKind kind) {
  PolygonSoup soup = parse_mesh(std::move(source));
  TriangleMesh mesh;
  const MeshReport report =
      kind == BodyKind::solid ? repair_and_check_solid(soup, &mesh) : repair_and_check_surface(soup, &mesh);
  if (report.defects.empty())
    check_mesh(mesh);
  else
    require(!report.defects.front().empty(), "a defect has a description");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Feed feed({data, size});
  const unsigned selection = feed.byte() % (2 * kMeshFormats.size());
  if (feed.empty()) return 0;  // read_mesh_source() rejects empty files
  MeshSource source{std::string("input") + kMeshFormats[selection % kMeshFormats.size()],
                    std::string(feed.rest().begin(), feed.rest().end())};
  try {
    load(std::move(source), selection < kMeshFormats.size() ? BodyKind::solid : BodyKind::surface);
  } catch (const MeshError& error) {
    require(std::string(error.what()).starts_with("input."), "a MeshError names the file");
  }
  return 0;
}
