// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/scene_output.hpp"

#include <algorithm>
#include <cctype>
#include <set>

#include "config/toml_file.hpp"
#include "tools/import/import_report.hpp"
#include "tools/import/length.hpp"
#include "tools/import/mesh_output.hpp"

namespace wrenchd {
namespace {

/// The names of obstacles and mesh files: letters, digits, '-', '_' and '.', all different.
class FileNames {
 public:
  std::string make(const std::string& stem, const std::string& name) {
    std::string plain = stem + "-" + name;
    for (char& c : plain)
      if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
    std::string file = plain + ".ply";
    for (int i = 2; !used_.insert(file).second; ++i) file = plain + "-" + std::to_string(i) + ".ply";
    return file;
  }

 private:
  std::set<std::string> used_;
};

std::string array(const Vector3d& v) {
  return "[" + to_text(v.x()) + ", " + to_text(v.y()) + ", " + to_text(v.z()) + "]";
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : printable_name(text)) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

}  // namespace

std::vector<std::string> add_scene(const std::filesystem::path& scene, const std::vector<PlacedBody>& bodies,
                                   const std::string& source, OutputSet& outputs) {
  constexpr double kMinTolerance_m = 1e-6, kMaxTolerance_m = 1e-3;
  double chord_mm = 0.0;
  bool all_exact = true;
  FileNames names;
  std::vector<std::string> files;
  std::string obstacles;
  for (const PlacedBody& placed : bodies) {
    const StatedError error{placed.body.chord_error_mm, 0.0};  // PLY has double precision
    chord_mm = std::max(chord_mm, error.mm);
    all_exact = all_exact && placed.body.has_exact_surface;
    const std::string file = names.make(scene.stem().string(), placed.name);
    outputs.add(scene.parent_path() / file,
                mesh_file_text(placed.body.mesh_mm, file, statement_text(placed.body, error, source)));
    files.push_back(file);
    obstacles += "\n[[obstacle]]\nname = " + quoted(placed.name) + "\nmesh = " + quoted(file) +
                 "\nscale = 0.001\nposition_m = " + array(placed.X_WM.translation_m) +
                 "\nrotation_vector_rad = " + array(rotation_vector(placed.X_WM.rotation)) + "\n" +
                 (placed.body.surface ? "kind = \"surface\"\n" : "");
  }
  const double tolerance_m = std::clamp(1e-3 * chord_mm, kMinTolerance_m, kMaxTolerance_m);
  outputs.add(scene,
              "# wrenchd scene, imported from " + printable_name(source) +
                  ".\n# Chord error of the obstacles, their largest distance from the exact surfaces: " +
                  rounded_up(chord_mm) + " mm.\n" +
                  (all_exact ? "" : "# The triangles of mesh files are as in the file.\n") +
                  "\n# Contacts may use surfaces outside of the meshes by as much as the chord error.\n"
                  "surface_tolerance_m = " +
                  to_text(tolerance_m) +
                  "\n\n# A placeholder: replace it by your tool.\n[tool]\nmesh = { make = \"sphere\", "
                  "triangles = 2000 }\nscale = 0.5\nmass = 0.2\n" +
                  obstacles);
  return files;
}

}  // namespace wrenchd
