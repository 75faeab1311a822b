// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/imported_body.hpp"

#include <cmath>

#include <Eigen/Geometry>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_union.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

constexpr double kRounding_mm = 1e-6;
constexpr const char* kSeparateParts =
    "make each part an obstacle with -o NAME.toml, select parts with --part, ";

PolygonSoup soup_of(const TriangleMesh& mesh) {
  PolygonSoup soup;
  soup.vertices = mesh.vertices_m;
  soup.faces.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) soup.faces.push_back({t[0], t[1], t[2]});
  return soup;
}

std::string defects_text(const MeshReport& report) {
  std::string text;
  for (const std::string& defect : report.defects) text += (text.empty() ? "" : "; ") + defect;
  return text;
}

/// Repairs and checks a mesh. Returns false and the defects if it is no solid.
bool make_solid(TriangleMesh& mesh, std::vector<std::string>& remarks, std::string& defects) {
  PolygonSoup soup = soup_of(mesh);
  TriangleMesh checked;
  const MeshReport report = repair_and_check_solid(soup, &checked);
  if (!report.solid()) {
    defects = defects_text(report);
    return false;
  }
  remarks.insert(remarks.end(), report.repairs.begin(), report.repairs.end());
  if (!report.tolerated.empty()) remarks.push_back(report.tolerated);
  mesh = std::move(checked);
  return true;
}

/// Two closed surfaces within chord_mm of each other differ in volume by at most the area times chord_mm, up
/// to curvature.
void require_volume(const ImportedPart& part) {
  double volume_mm3 = 0.0;
  for (const TriangleMesh& mesh : part.meshes) volume_mm3 += geometric_properties(mesh).volume_mm3;
  constexpr double kCurvature = 1.5, kRounding = 1e-6;
  const double allowed_mm3 =
      kCurvature * part.exact.area_mm2 * part.chord_error_mm + kRounding * std::abs(part.exact.volume_mm3);
  if (std::abs(volume_mm3 - part.exact.volume_mm3) <= allowed_mm3) return;
  const Vector3d& at = part.exact.centre_mm;
  throw ImportError("part '" + part.name + "' near " + place_text(at.x(), at.y(), at.z()) +
                    ": the volume of its mesh, " + short_number(volume_mm3) +
                    " mm^3, is not that of its surfaces, " + short_number(part.exact.volume_mm3) +
                    " mm^3; repair the solid in the CAD program");
}

void add_surface(const std::vector<TriangleMesh>& meshes, const std::string& defects, ImportedBody& body) {
  PolygonSoup soup = soup_of(together(meshes));
  const MeshReport report = repair_and_check_surface(soup, &body.mesh_mm);
  if (!report.defects.empty()) throw ImportError(defects_text(report));
  body.surface = true;
  body.remarks.push_back("is no closed solid (" + defects + "); use it with kind = \"surface\"");
}

/// Returns the solid, grown about its centre of mass so that no point moves by more than `by_mm`.
TriangleMesh grown(const TriangleMesh& solid, double by_mm) {
  const Vector3d centre = geometric_properties(solid).centre_mm;
  double radius_mm = by_mm;
  for (const Vector3d& p : solid.vertices_m) radius_mm = std::max(radius_mm, (p - centre).norm());
  TriangleMesh out = solid;
  for (Vector3d& p : out.vertices_m) p += by_mm / radius_mm * (p - centre);
  return out;
}

/// Returns the union. If the surfaces touch in a way that CGAL cannot unite, tries again with solids that are
/// grown by different lengths of at most `growth_mm`. is_grown: receives whether this was needed.
UnitedMesh unite_touching(const std::vector<TriangleMesh>& solids, double growth_mm, bool& is_grown) {
  is_grown = false;
  UnitedMesh united = unite(solids);
  if (united.united || growth_mm <= 0.0) return united;
  std::vector<TriangleMesh> larger;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const double share = static_cast<double>(i + 1) / static_cast<double>(solids.size());
    larger.push_back(grown(solids[i], share * growth_mm));
  }
  UnitedMesh again = unite(larger);
  if (!again.united) return united;
  is_grown = true;
  return again;
}

/// The volume that two or more solids have in common.
struct Overlap {
  double volume_mm3 = 0.0;
  double thickness_mm = 0.0;  ///< mean
  Vector3d centre_mm = Vector3d::Zero();
};

/// Returns the overlap of solids. For two solids A and B, volume and area of their intersection are the sums
/// of both solids minus those of their union. A plate of area F on each of its sides has the thickness V / F.
Overlap overlap_of(const std::vector<TriangleMesh>& solids, const TriangleMesh& united) {
  const GeometricProperties whole = geometric_properties(united);
  Overlap overlap{-whole.volume_mm3, 0.0, -whole.volume_mm3 * whole.centre_mm};
  double area_mm2 = -whole.area_mm2, sum_mm3 = 0.0;
  for (const TriangleMesh& solid : solids) {
    const GeometricProperties one = geometric_properties(solid);
    sum_mm3 += one.volume_mm3;
    overlap.volume_mm3 += one.volume_mm3;
    overlap.centre_mm += one.volume_mm3 * one.centre_mm;
    area_mm2 += one.area_mm2;
  }
  constexpr double kRounding = 1e-9;
  if (overlap.volume_mm3 <= kRounding * sum_mm3) return {};
  overlap.centre_mm /= overlap.volume_mm3;
  overlap.thickness_mm = area_mm2 > 0.0 ? 2.0 * overlap.volume_mm3 / area_mm2 : HUGE_VAL;
  return overlap;
}

Eigen::AlignedBox3d box_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.vertices_m) box.extend(p);
  return box;
}

/// Throws ImportError that names the first two solids that overlap by more than `allowed_mm`.
void require_no_overlap(const std::vector<TriangleMesh>& solids, const std::vector<std::string>& names,
                        double allowed_mm, double growth_mm) {
  constexpr int kMaxPairs = 500;  // a search through more of them could take hours
  std::vector<Eigen::AlignedBox3d> boxes;
  for (const TriangleMesh& solid : solids) boxes.push_back(box_of(solid));
  int pairs = 0;
  for (std::size_t i = 0; i < solids.size(); ++i)
    for (std::size_t j = 0; j < i && pairs < kMaxPairs; ++j) {
      if (!boxes[i].intersects(boxes[j])) continue;
      ++pairs;
      const std::vector<TriangleMesh> both = {solids[j], solids[i]};
      bool is_grown = false;
      const UnitedMesh united = unite_touching(both, growth_mm, is_grown);
      const Overlap overlap = united.united ? overlap_of(both, united.mesh) : Overlap{};
      if (united.united && overlap.thickness_mm <= allowed_mm) continue;
      const Eigen::AlignedBox3d common = boxes[i].intersection(boxes[j]);
      const Vector3d at = united.united ? overlap.centre_mm : Vector3d(common.center());
      const bool one_part = names[i] == names[j];
      throw ImportError((one_part ? "two solids of part '" + names[i] + "'"
                                  : "parts '" + names[j] + "' and '" + names[i] + "'") +
                        (united.united ? " overlap by " + short_number(overlap.volume_mm3) + " mm^3"
                                       : " touch or overlap, and their union cannot be computed,") +
                        " near " + place_text(at.x(), at.y(), at.z()) +
                        "; correct this in the CAD program, " + (one_part ? "" : kSeparateParts) +
                        (united.united ? "or accept the union with --unite"
                                       : "or accept all faces as a surface with --surface"));
    }
}

/// Takes the meshes together if they are apart, otherwise their union. Throws ImportError if the solids have
/// exact surfaces and overlap, unless joining.unite is true.
void add_solids(const std::vector<TriangleMesh>& solids, const std::vector<std::string>& names,
                const Joining& joining, ImportedBody& body) {
  if (solids.size() == 1) {
    body.mesh_mm = solids.front();
    return;
  }
  TriangleMesh all = together(solids);
  // The union is needed only where solids touch or one contains another, and it takes long for fine meshes.
  std::string defects;
  std::vector<std::string> repairs;
  TriangleMesh apart = all;
  if (make_solid(apart, repairs, defects) && repairs.empty()) {
    body.mesh_mm = std::move(apart);
    return;
  }
  // The growth may use what the chord error leaves.
  constexpr double kGrowth = 0.05;
  const double growth_mm = body.has_exact_surface ? std::clamp(joining.chord_mm - body.chord_error_mm, 0.0,
                                                               kGrowth * joining.chord_mm)
                                                  : 0.0;
  bool is_grown = false;
  UnitedMesh united = unite_touching(solids, growth_mm, is_grown);
  body.mesh_mm = std::move(united.mesh);
  const Overlap overlap = overlap_of(solids, body.mesh_mm);
  // Round faces that touch have different segments, which overlap by the chord errors of both.
  const double allowed_mm = 2.0 * (body.chord_error_mm + growth_mm) + kRounding_mm;
  const bool overlaps = overlap.thickness_mm > (body.has_exact_surface ? allowed_mm : 0.0);
  if (body.has_exact_surface && !joining.unite && !(joining.surface && !united.united) &&
      (!united.united || overlap.volume_mm3 > 0.0))
    require_no_overlap(solids, names, allowed_mm, growth_mm);
  if (is_grown) body.chord_error_mm += growth_mm;
  body.overlap_mm3 = overlap.volume_mm3;
  const std::string count = std::to_string(solids.size()) + " solids ";
  if (!united.united) {
    const std::string defect = count + "touch or overlap, and their union cannot be computed";
    if (!joining.surface)
      throw ImportError(defect + "; " + kSeparateParts + "or accept all faces as a surface with --surface");
    return add_surface(solids, defect, body);
  }
  if (overlaps)
    body.remarks.push_back(count + "overlap by " + short_number(body.overlap_mm3) +
                           " mm^3; the mesh is their union, and at the edges where they meet its distance "
                           "from the exact union can exceed the chord error");
  else
    body.remarks.push_back(count +
                           "touch each other; the mesh is their union, and where round faces touch, gaps as "
                           "thin as the chord error can remain");
}

}  // namespace

ImportedBody join_parts(ImportedFile file, const Joining& joining) {
  ImportedBody body;
  body.remarks = std::move(file.remarks);
  body.has_exact_surface = true;
  std::vector<TriangleMesh> solids, meshes;
  std::vector<std::string> names;  // of the parts of the solids
  std::string first_defect;
  bool first = true;
  for (ImportedPart& part : file.parts) {
    if (part.has_exact_surface) require_volume(part);
    body.has_exact_surface = body.has_exact_surface && part.has_exact_surface;
    body.exact = first ? part.exact : part.has_exact_surface ? sum(body.exact, part.exact) : body.exact;
    first = false;
    if (part.chord_error_mm >= body.chord_error_mm) {
      body.chord_error_mm = part.chord_error_mm;
      body.worst_place = part.worst_place;
    }
    for (TriangleMesh& mesh : part.meshes) {
      std::string defects;
      TriangleMesh solid = mesh;
      std::vector<std::string> repairs;
      if (make_solid(solid, repairs, defects)) {
        for (const std::string& repair : repairs)
          body.remarks.push_back("part '" + part.name + "': " + repair);
        solids.push_back(std::move(solid));
        names.push_back(part.name);
      } else if (first_defect.empty()) {
        first_defect = "part '" + part.name + "': " + defects;
        if (part.has_exact_surface && !joining.surface)
          throw ImportError(first_defect +
                            "; repair the solid in the CAD program, use a finer --chord, or accept it as a "
                            "surface with --surface");
      }
      meshes.push_back(std::move(mesh));
    }
  }
  if (solids.size() == meshes.size()) {
    add_solids(solids, names, joining, body);
    return body;
  }
  // Groups of a mesh file may be pieces of one surface.
  TriangleMesh whole = together(meshes);
  std::string defects;
  std::vector<std::string> repairs;
  if (meshes.size() > 1 && make_solid(whole, repairs, defects)) {
    body.remarks.insert(body.remarks.end(), repairs.begin(), repairs.end());
    body.mesh_mm = std::move(whole);
    return body;
  }
  if (meshes.size() == 1) defects = first_defect;
  if (!joining.surface)
    throw ImportError(defects +
                      "; close the mesh in a mesh editor, or accept it as a surface with --surface");
  add_surface(meshes, defects, body);
  return body;
}

}  // namespace wrenchd
