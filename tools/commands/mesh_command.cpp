// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/meshes/mesh_repair.hpp"
#include "collision/meshes/mesh_simplifier.hpp"
#include "collision/meshes/mesh_size.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/query_cost.hpp"
#include "collision/scene.hpp"
#include "collision/tool_body.hpp"
#include "core/inertia.hpp"
#include "core/scene_settings.hpp"
#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/output_file.hpp"

namespace wrenchd {
namespace {

void print_row(const char* label, const Vector3d& v, const char* unit) {
  std::printf("%-18s %.9g %.9g %.9g %s\n", label, v.x(), v.y(), v.z(), unit);
}

PolygonSoup read_soup(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  MeshSource source = read_mesh_source(file);
  const std::size_t size = source.bytes.size();
  if (size >= MeshLoader::kLargeMeshBytes)
    print_note(name + ": reading " + with_thousands_separators(size / 1'000'000) + " MB");
  PolygonSoup soup = parse_mesh(std::move(source));
  if (soup.faces.size() >= MeshLoader::kLargeMeshTriangles)
    print_note(name + ": " + with_thousands_separators(soup.faces.size()) + " faces, checking");
  return soup;
}

/// Returns what queries cost while the solid is pressed onto a copy of itself. mesh: in metres.
std::string self_contact_text(TriangleMesh mesh) {
  constexpr double kEstimate_s = 2.0;
  ToolBody tool = tool_body(std::move(mesh), 1.0, 1.0);
  const auto bvh = std::make_shared<const MeshBvh>(tool.mesh);
  const Scene scene(std::move(tool), {}, {}, {MeshObstacle("copy", bvh, Pose{})}, bvh);
  return text(estimate_query_cost(scene, kEstimate_s)) + ", on a copy of itself";
}

/// Prints what a mesh that is no solid gives as a surface, if it can be one.
void print_surface(PolygonSoup soup, const std::filesystem::path& file, double scale) {
  TriangleMesh mesh;
  if (!check_surface(soup, &mesh).defects.empty()) return;
  const std::size_t triangles = mesh.triangles.size();
  ToolSettings settings;
  settings.scale = scale;
  settings.kind = BodyKind::surface;
  settings.inertia_source = InertiaSource::hull;
  ConvexBody hull = convex_hull(mesh);
  const ToolBody tool = tool_body(std::move(mesh), std::move(hull), settings);
  require_usable(tool.solid, file, scale);
  const Matrix3d& H = tool.solid.inertia.H_kg_m2;
  std::printf("%-18s with kind = \"surface\": %zu triangles; as a tool, %s:\n", "usable", triangles,
              inertia_text(settings).c_str());
  std::printf("%-18s %.9g m^3\n", "volume of the hull", tool.solid.volume_m3);
  print_row("centre of mass", tool.solid.p_MT_m, "m");
  print_row("inertia xx yy zz", H.diagonal(), "m^2 (per kg, about the centre of mass)");
  print_row("inertia xy xz yz", {H(0, 1), H(0, 2), H(1, 2)}, "m^2");
}

void print_solid(TriangleMesh mesh, const std::filesystem::path& file, double scale) {
  const auto implausible = implausible_size(mesh, scale, kPlausibleToolSize);
  for (Vector3d& p : mesh.vertices_m) p *= scale;
  const SolidProperties solid = solid_properties(mesh, 1.0);
  require_usable(solid, file, scale);
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.vertices_m) box.extend(p);
  const Matrix3d& H = solid.inertia.H_kg_m2;
  std::printf("%-18s %zu\n", "triangles", mesh.triangles.size());
  print_row("size", box.sizes(), "m");
  if (implausible) std::printf("%-18s as a tool, %s\n", "remark", implausible->c_str());
  std::printf("%-18s %.9g m^3\n", "volume", solid.volume_m3);
  print_row("centre of mass", solid.p_MT_m, "m");
  print_row("inertia xx yy zz", H.diagonal(), "m^2 (per kg, uniform solid, about the centre of mass)");
  print_row("inertia xy xz yz", {H(0, 1), H(0, 2), H(1, 2)}, "m^2");
  const std::size_t triangles = mesh.triangles.size();
  const double tolerance_m = simplification_tolerance_m(mesh, SceneSettings{}.surface_tolerance_m);
  SimplifiedMesh simplified = simplify_enclosing(std::move(mesh), tolerance_m);
  std::printf(
      "%-18s %s\n", "contact surface",
      contact_surface_text(simplified.mesh.triangles.size(), triangles, simplified.distance_m).c_str());
  std::printf("%-18s %s\n", "contact queries", self_contact_text(std::move(simplified.mesh)).c_str());
}

class MeshCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* mesh = app.add_subcommand("mesh",
                                        "Show volume, inertia, repairs and defects of a mesh, or generate a\n"
                                        "mesh for experiments");
    auto* files = mesh->add_option("files", files_,
                                   "OFF, OBJ, STL or PLY file; several files are the parts of one body")
                      ->check(not_empty());
    mesh->add_option("--scale", scale_, "metres per mesh unit")
        ->check(number_in_range(1e-9, 1e6))
        ->capture_default_str();
    std::vector<std::string> kinds;
    std::string list = "Kinds of generated meshes:\n";
    for (const auto& [name, description] : mesh_kinds()) {
      kinds.push_back(name);
      list += "  " + name + std::string(10 - name.size(), ' ') + description + '\n';
    }
    auto* make = mesh->add_option("--make", generated_.kind, "generate a solid of this kind, in metres")
                     ->check(one_of(kinds))
                     ->excludes(files);
    mesh->add_option("--triangles", generated_.triangles, "approximate number of triangles")
        ->check(CLI::Range(GeneratedMesh::kMinTriangles, GeneratedMesh::kMaxTriangles))
        ->needs(make)
        ->capture_default_str();
    mesh->add_option("--seed", generated_.seed, "seed of the random shape of bumpy meshes")
        ->needs(make)
        ->capture_default_str();
    mesh->add_option("-o,--output", output_, "OFF file to write; - writes standard output")
        ->check(not_empty())
        ->needs(make)
        ->capture_default_str();
    mesh->footer(list);
    mesh->callback([this] { exit_code_ = run(); });
  }

 private:
  int run() {
    if (generated_.kind.empty()) return describe();
    std::ostringstream text;
    write_off(text, make_mesh(generated_));
    write_output(output_, text.str());
    return kExitDone;
  }

  int describe() {
    if (files_.empty()) throw CLI::RequiredError("mesh: a file, or --make KIND,");
    return files_.size() == 1 ? describe_file(files_.front()) : describe_parts();
  }

  int describe_file(const std::filesystem::path& file) {
    PolygonSoup soup = read_soup(file);
    std::printf("%-18s %zu\n%-18s %zu\n", "vertices", soup.vertices.size(), "faces", soup.faces.size());
    TriangleMesh mesh;
    const MeshReport report = repair_and_check_solid(soup, &mesh);
    for (const std::string& repair : report.repairs) std::printf("%-18s %s\n", "repaired", repair.c_str());
    if (!report.tolerated.empty()) std::printf("%-18s %s\n", "tolerated", report.tolerated.c_str());
    std::printf("%-18s %s\n%-18s %s\n", "closed", report.closed ? "yes" : "no", "consistent",
                report.consistent ? "yes" : "no");
    if (!report.solid()) {
      print_note(rejection_text(file, soup, BodyKind::solid, report));
      print_surface(std::move(soup), file, scale_);
      return kExitDefects;
    }
    print_solid(std::move(mesh), file, scale_);
    return kExitDone;
  }

  /// Several files are one body, as in a scene's `meshes`.
  int describe_parts() {
    MeshLoader loader = make_mesh_loader();
    std::shared_ptr<const LoadedMesh> body;
    try {
      body = loader.load_parts(files_, BodyKind::solid);
    } catch (const MeshError& error) {
      print_note(error.what());
      return kExitDefects;
    }
    for (const std::string& repair : body->repairs) std::printf("%-18s %s\n", "repaired", repair.c_str());
    print_solid(body->mesh, body->file, scale_);
    return kExitDone;
  }

  std::vector<std::filesystem::path> files_;
  double scale_ = 1.0;
  GeneratedMesh generated_;
  std::string output_ = "-";
};

}  // namespace

std::unique_ptr<Subcommand> make_mesh_command() {
  return std::make_unique<MeshCommand>();
}

}  // namespace wrenchd
