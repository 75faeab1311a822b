// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: collision/meshes/mesh_file.cpp collision/meshes/mesh_validation.cpp
// collision/meshes/ply_validation.cpp collision/meshes/mesh_source.cpp collision/meshes/mesh_repair.cpp
// collision/meshes/mesh_check.cpp collision/meshes/half_edges.cpp
#include "tests/fuzz/fuzz_mesh.hpp"

#include <string>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "core/finite.hpp"
#include "tests/fuzz/feed.hpp"

// Any bytes as a mesh file: refused with a MeshError, found defective, or a mesh of finite points whose
// triangles are there. Time and memory are bounded by the options of the run.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

void check_mesh(const TriangleMesh& mesh) {
  hold(!mesh.triangles.empty(), "a mesh has triangles");
  for (const Vector3d& v : mesh.vertices_m) hold(is_finite(v), "points are finite");
  for (const auto& triangle : mesh.triangles)
    for (const auto corner : triangle) hold(corner < mesh.vertices_m.size(), "corners are there");
}

void load(MeshSource source, BodyKind kind) {
  PolygonSoup soup = parse_mesh(std::move(source));
  TriangleMesh mesh;
  const MeshReport report =
      kind == BodyKind::solid ? repair_and_check_solid(soup, &mesh) : repair_and_check_surface(soup, &mesh);
  if (report.defects.empty())
    check_mesh(mesh);
  else
    hold(!report.defects.front().empty(), "a defect has words");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Feed feed({data, size});
  const unsigned what = feed.byte() % (2 * kMeshFormats.size());
  if (feed.empty()) return 0;  // an empty file is refused before it is parsed
  MeshSource source{std::string("input") + kMeshFormats[what % kMeshFormats.size()],
                    std::string(feed.rest().begin(), feed.rest().end())};
  try {
    load(std::move(source), what < kMeshFormats.size() ? BodyKind::solid : BodyKind::surface);
  } catch (const MeshError& error) {
    hold(std::string(error.what()).starts_with("input."), "a refusal names the file");
  }
  return 0;
}
