// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/imported_file.hpp"

#include <cstdint>

#include "collision/meshes/packer.hpp"
#include "core/inertia.hpp"

namespace wrenchd {
namespace {

/// Calls `each` for all numbers of the properties.
template <class Each, class Properties>
void for_each_number(Properties& properties, const Each& each) {
  each(properties.volume_mm3);
  each(properties.area_mm2);
  for (int i = 0; i < 3; ++i) each(properties.centre_mm[i]);
  for (int i = 0; i < 9; ++i) each(properties.inertia_mm5(i / 3, i % 3));
}

}  // namespace

GeometricProperties sum(const GeometricProperties& a, const GeometricProperties& b) {
  GeometricProperties both;
  both.volume_mm3 = a.volume_mm3 + b.volume_mm3;
  both.area_mm2 = a.area_mm2 + b.area_mm2;
  both.centre_mm = (a.volume_mm3 * a.centre_mm + b.volume_mm3 * b.centre_mm) / both.volume_mm3;
  for (const GeometricProperties* one : {&a, &b}) {  // parallel axis theorem
    const Vector3d d = one->centre_mm - both.centre_mm;
    both.inertia_mm5 +=
        one->inertia_mm5 + one->volume_mm3 * (d.squaredNorm() * Matrix3d::Identity() - d * d.transpose());
  }
  return both;
}

GeometricProperties geometric_properties(const TriangleMesh& mesh_mm) {
  const SolidProperties once = solid_properties(mesh_mm, 1.0);
  GeometricProperties out;
  out.volume_mm3 = once.volume_m3;
  out.centre_mm = once.p_MT_m;
  out.inertia_mm5 = once.volume_m3 * once.inertia.H_kg_m2;
  for (const auto& t : mesh_mm.triangles) {
    const Vector3d& a = mesh_mm.vertices_m[t[0]];
    out.area_mm2 += 0.5 * (mesh_mm.vertices_m[t[1]] - a).cross(mesh_mm.vertices_m[t[2]] - a).norm();
  }
  return out;
}

std::string packed(const ImportedFile& file) {
  std::string bytes;
  const Packer pack(bytes);
  pack(file.format);
  pack(file.unit);
  pack(file.remarks);
  pack(static_cast<std::uint64_t>(file.parts.size()));
  for (const ImportedPart& part : file.parts) {
    pack(part.name);
    pack(part.has_exact_surface);
    for_each_number(part.exact, [&](double x) { pack(x); });
    pack(part.chord_error_mm);
    pack(part.worst_place);
    pack(static_cast<std::uint64_t>(part.meshes.size()));
    for (const TriangleMesh& mesh : part.meshes) {
      pack(mesh.vertices_m);
      pack(mesh.triangles);
    }
  }
  return bytes;
}

std::string packed(const std::vector<PartSummary>& parts) {
  std::string bytes;
  const Packer pack(bytes);
  pack(static_cast<std::uint64_t>(parts.size()));
  for (const PartSummary& part : parts) {
    pack(part.name);
    pack(part.description);
  }
  return bytes;
}

bool unpack(const std::string& bytes, ImportedFile& file) {
  const Unpacker take(bytes);
  std::uint64_t parts = 0;
  take(file.format);
  take(file.unit);
  take(file.remarks);
  take(parts);
  for (std::uint64_t i = 0; i < parts && take.good(); ++i) {
    ImportedPart& part = file.parts.emplace_back();
    std::uint64_t meshes = 0;
    take(part.name);
    take(part.has_exact_surface);
    for_each_number(part.exact, [&](double& x) { take(x); });
    take(part.chord_error_mm);
    take(part.worst_place);
    take(meshes);
    for (std::uint64_t k = 0; k < meshes && take.good(); ++k) {
      TriangleMesh& mesh = part.meshes.emplace_back();
      take(mesh.vertices_m);
      take(mesh.triangles);
    }
  }
  return take.at_end();
}

bool unpack(const std::string& bytes, std::vector<PartSummary>& parts) {
  const Unpacker take(bytes);
  std::uint64_t count = 0;
  take(count);
  for (std::uint64_t i = 0; i < count && take.good(); ++i) {
    PartSummary& part = parts.emplace_back();
    take(part.name);
    take(part.description);
  }
  return take.at_end();
}

}  // namespace wrenchd
