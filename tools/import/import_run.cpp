// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import_run.hpp"

#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/import_file.hpp"
#include "tools/import/import_report.hpp"
#include "tools/import/imported_body.hpp"
#include "tools/import/length.hpp"
#include "tools/import/mesh_output.hpp"
#include "tools/import/output_set.hpp"
#include "tools/import/robot_import.hpp"
#include "tools/import/scene_output.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr double kMinChord_mm = 1e-6, kMaxChord_mm = 1e3;
/// Share of the chord error that is left to the rounding of a file in single precision. It suffices if
/// no coordinate exceeds about 100,000 times the chord error.
constexpr double kRoundingShare = 0.01;

void print_row(const char* label, const std::string& value) {
  std::printf("%-18s %s\n", label, value.c_str());
}

double chord_of(const ImportOptions& options) {
  const std::string text = options.chord.empty() ? ImportOptions::kDefaultChord : options.chord;
  double chord_mm = 0.0;
  try {
    chord_mm = parse_length_mm(text);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(std::string("--chord: ") + error.what());
  }
  if (!(chord_mm >= kMinChord_mm && chord_mm <= kMaxChord_mm))
    throw std::runtime_error("--chord: " + text + " is outside of 1e-6mm to 1m; give a length such as " +
                             ImportOptions::kDefaultChord);
  return chord_mm;
}

ImportJob job_of(const ImportOptions& options) {
  ImportJob job;
  job.file = options.file;
  job.chord_mm = chord_of(options);
  job.parts = options.parts;
  job.skip_surfaces = options.skip_surfaces;
  job.max_triangles = options.max_triangles;
  if (options.unit.empty()) return job;
  const auto unit_mm = unit_length_mm(options.unit);
  if (!unit_mm)
    throw std::runtime_error("--unit: unknown unit '" + printable_name(options.unit) + "'; use one of " +
                             known_units());
  job.unit_mm = *unit_mm;
  return job;
}

/// Rejects options that have no effect for this kind of file.
void require_fitting_options(const ImportOptions& options, SourceKind kind) {
  if (kind == SourceKind::mesh && !options.chord.empty())
    throw ImportError(
        "--chord belongs to CAD files; the triangles of a mesh file stay as they are: leave it out");
  if (kind != SourceKind::cad && options.skip_surfaces)
    throw ImportError("--skip-surfaces belongs to CAD files; leave it out");
  if (kind != SourceKind::cad && options.unite)
    throw ImportError(
        "--unite belongs to CAD files; the parts of a mesh file are united without it: leave it out");
  if (kind == SourceKind::urdf && !options.unit.empty())
    throw ImportError("URDF files are in metres; leave --unit out");
  if (kind != SourceKind::urdf && !options.joints.empty())
    throw ImportError("--joint belongs to URDF files; leave it out");
  if (kind != SourceKind::urdf && !options.packages.empty())
    throw ImportError("--package belongs to URDF files; leave it out");
}

Joining joining_of(const ImportOptions& options, const ImportJob& job) {
  return {options.surface, options.unite, job.chord_mm};
}

RobotJob robot_of(const ImportOptions& options, const ImportJob& job) {
  return {job, options.joints, options.packages, joining_of(options, job)};
}

void print_list(const ImportOptions& options, const ImportJob& job, SourceKind kind) {
  for (const PartSummary& part :
       kind == SourceKind::urdf ? list_links(robot_of(options, job)) : list_parts(job))
    std::printf("%-30s %s\n", part.name.c_str(), part.description.c_str());
}

/// A mesh file that is ready to be written.
struct MeshOutput {
  StatedError error;
  std::string content;
};

/// Makes the content of a mesh file, and checks that wrenchd accepts it after rounding. chord_mm: the largest
/// error for a CAD file.
MeshOutput make_output(const ImportedBody& body, const fs::path& file, const fs::path& source,
                       double chord_mm) {
  MeshOutput out;
  out.error.rounding_mm = rounding_mm(body.mesh_mm, file);
  out.error.mm = body.chord_error_mm + out.error.rounding_mm;
  if (body.has_exact_surface && out.error.mm > chord_mm)
    throw ImportError("single precision in " + file.filename().string() + " adds " +
                      rounded_up(out.error.rounding_mm) + " mm to the chord error of " +
                      rounded_up(body.chord_error_mm) +
                      " mm; write a .off or .ply file, or use a coarser --chord");
  out.content =
      mesh_file_text(body.mesh_mm, file, statement_text(body, out.error, source.filename().string()));
  if (out.error.rounding_mm == 0.0 || body.surface) return out;
  PolygonSoup soup = parse_mesh({file, out.content});
  if (!repair_and_check_solid(soup).solid())
    throw ImportError("after rounding to single precision the mesh is no solid; write a .off or .ply file");
  return out;
}

void print_content(const ImportedFile& file, const std::string& name) {
  std::size_t meshes = 0;
  for (const ImportedPart& part : file.parts) meshes += part.meshes.size();
  const bool cad = !file.parts.empty() && file.parts.front().has_exact_surface;
  print_row("file", name + ": " + file.format + ", unit " + file.unit);
  print_row("parts", std::to_string(file.parts.size()) + " with " + std::to_string(meshes) +
                         (cad ? (meshes == 1 ? " solid" : " solids") : (meshes == 1 ? " mesh" : " meshes")));
}

void print_remarks(const ImportedBody& body) {
  for (const std::string& remark : body.remarks) print_row("remark", remark);
}

void import_to_mesh(const ImportOptions& options, const ImportJob& job) {
  ImportJob meshing = job;
  if (has_single_precision(options.output)) meshing.chord_mm *= 1.0 - kRoundingShare;
  ImportedFile file = import_file(meshing);
  print_content(file, job.file.filename().string());
  const ImportedBody body = join_parts(std::move(file), joining_of(options, meshing));
  if (options.output.empty()) {
    print_remarks(body);
    std::fputs(report_text(body, {body.chord_error_mm, 0.0}).c_str(), stdout);
    return;
  }
  const MeshOutput made = make_output(body, options.output, job.file, job.chord_mm);
  OutputSet outputs;
  outputs.add(options.output, made.content);
  outputs.commit();
  print_remarks(body);
  std::fputs(report_text(body, made.error).c_str(), stdout);
  print_row("in a scene", "mesh = \"" + fs::path(options.output).filename().string() + "\", scale = 0.001" +
                              (body.surface ? ", kind = \"surface\"" : ""));
}

bool is_scene(const fs::path& file) {
  return file.extension() == ".toml";
}

/// Returns each part of a file as a body at its place.
std::vector<PlacedBody> separate_bodies(ImportedFile file, const Joining& joining) {
  std::vector<PlacedBody> bodies;
  for (ImportedPart& part : file.parts) {
    ImportedFile one;
    one.format = file.format;
    one.unit = file.unit;
    const std::string name = part.name;
    one.parts.push_back(std::move(part));
    bodies.push_back({name, join_parts(std::move(one), joining), {}});
  }
  return bodies;
}

void import_to_scene(const ImportOptions& options, const ImportJob& job, SourceKind kind) {
  std::vector<PlacedBody> bodies;
  std::vector<std::string> remarks;
  const std::string source = job.file.filename().string();
  if (kind == SourceKind::urdf) {
    bodies = import_robot(robot_of(options, job), remarks);
    print_row("file", source + ": URDF, unit m");
  } else {
    ImportedFile file = import_file(job);
    print_content(file, source);
    remarks = file.remarks;
    bodies = separate_bodies(std::move(file), joining_of(options, job));
  }
  OutputSet outputs;
  std::vector<std::string> files(bodies.size());
  if (!options.output.empty()) {
    files = add_scene(options.output, bodies, source, outputs);
    outputs.commit();
  }
  for (const std::string& remark : remarks) print_row("remark", remark);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const PlacedBody& placed = bodies[i];
    std::printf("\n");
    print_row("obstacle", placed.name + (files[i].empty() ? "" : ": " + files[i]));
    const Vector3d& p = placed.X_WM.translation_m;
    print_row("position", place_text(1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z()));
    print_remarks(placed.body);
    std::fputs(report_text(placed.body, {placed.body.chord_error_mm, 0.0}).c_str(), stdout);
  }
}

/// Rejects an output that cannot be written, before the import takes its time.
void check_output(const ImportOptions& options, SourceKind kind) {
  if (options.output.empty() || is_scene(options.output)) return;
  if (kind == SourceKind::urdf)
    throw ImportError("a robot becomes a scene with one obstacle for each link; name a .toml file with -o");
  require_mesh_extension(options.output);
}

}  // namespace

void run_import(const ImportOptions& options) {
  const ImportJob job = job_of(options);
  try {
    const SourceKind kind = source_kind(job.file);
    require_fitting_options(options, kind);
    if (options.list) return print_list(options, job, kind);
    check_output(options, kind);
    if (kind == SourceKind::urdf || is_scene(options.output)) return import_to_scene(options, job, kind);
    import_to_mesh(options, job);
  } catch (const ImportError& error) {
    throw std::runtime_error(job.file.string() + ": " + error.what());
  }
}

}  // namespace wrenchd
