// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import_options.hpp"

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"

namespace wrenchd {

void add_import_options(CLI::App& command, ImportOptions& options) {
  command
      .add_option("file", options.file,
                  "STEP (.step, .stp), BREP (.brep), glTF (.gltf, .glb), 3MF (.3mf), COLLADA (.dae),\n"
                  "OBJ (.obj), PLY (.ply), STL (.stl) or URDF (.urdf) file")
      ->required()
      ->check(not_empty());
  command
      .add_option("-o,--output", options.output,
                  "file to write: a mesh (.stl, .off, .ply, .obj), in millimetres, for scale = 0.001; or a\n"
                  "scene (.toml) with one obstacle for each part and its meshes beside it; without it the\n"
                  "command only reports")
      ->check(not_empty());
  command
      .add_option("--chord", options.chord,
                  std::string("largest distance of the triangles from the exact surface, with its unit; the\n"
                              "command measures it and refines the mesh until it holds; default ") +
                      ImportOptions::kDefaultChord)
      ->check(not_empty("give a length such as 0.02mm"));
  command.add_option("--unit", options.unit, "unit of a file that states none: um, mm, cm, m, in or ft")
      ->check(not_empty("name a unit such as mm"));
  command
      .add_option("--part", options.parts,
                  "import only the part with this name; several of them are one body; --list shows the names")
      ->check(not_empty("name a part"))
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_flag("--list", options.list, "list the parts, and import nothing");
  command.add_flag("--skip-surfaces", options.skip_surfaces,
                   "leave out faces of a CAD file that bound no solid");
  command.add_flag("--unite", options.unite,
                   "accept solids of a CAD file that overlap: the mesh is their union");
  command.add_flag("--surface", options.surface,
                   "accept a mesh that is no closed solid; a scene takes it with kind = \"surface\"");
  command
      .add_option("--joint", options.joints,
                  "URDF: NAME=VALUE, position of a joint in rad or m; joints that are not named are at 0")
      ->check(not_empty("give NAME=VALUE"))
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command
      .add_option("--package", options.packages,
                  "URDF: NAME=DIR, directory of a package, for meshes named package://NAME/...")
      ->check(not_empty("give NAME=DIR"))
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option("--max-triangles", options.max_triangles, "reject a result with more triangles")
      ->check(CLI::Range(std::size_t{100}, std::size_t{20'000'000}))
      ->capture_default_str();
}

}  // namespace wrenchd
