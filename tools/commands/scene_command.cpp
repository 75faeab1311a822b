// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>

#include <CLI/CLI.hpp>

#include "core/generated_mesh.hpp"
#include "daemon/option_checks.hpp"
#include "tools/commands/daemon_command.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/live_scene.hpp"

namespace wrenchd {
namespace {

/// scene list, load, reset, add, move and remove.
class SceneCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* scene = add_daemon_command(
        app, "scene", "Show the scene, or change it while the daemon runs; without a command, list it",
        options_);
    scene->require_subcommand(0, 1);
    scene->callback([this, scene] {
      if (scene->get_subcommands().empty()) run_scene_list(options_);
    });
    add(*scene, "list", "List the tool and the obstacles with their present poses",
        [this] { run_scene_list(options_); });
    add_load(*scene);
    add(*scene, "reset", "Load the file of the present scene again: it undoes add, move and remove",
        [this] { run_scene_reset(options_); });
    add_add(*scene);
    add_move(*scene);
    CLI::App* remove = add(*scene, "remove", "Remove an obstacle; its force fades out",
                           [this] { run_scene_remove(edit_, options_); });
    add_name(*remove);
  }

 private:
  template <class Run>
  CLI::App* add(CLI::App& scene, const char* name, const char* description, Run run) {
    CLI::App* command = add_daemon_command(scene, name, description, options_);
    command->callback([run] { run(); });
    return command;
  }

  void add_name(CLI::App& command) {
    command.add_option("name", edit_.subject, "name of the obstacle (wrenchctl scene list)")
        ->required()
        ->check(not_empty("name an obstacle"));
  }

  void add_load(CLI::App& scene) {
    CLI::App* load =
        add(scene, "load", "Replace the scene, tool included", [this] { run_scene_load(edit_, options_); });
    load->add_option("file", edit_.subject,
                     "scene file, or the name of a scene along the daemon's search path, as in peg_in_hole")
        ->required()
        ->check(not_empty());
  }

  void add_add(CLI::App& scene) {
    CLI::App* command = add(scene, "add", "Add an obstacle: a mesh file, a generated mesh or a half space",
                            [this] { run_scene_add(edit_, options_); });
    command
        ->add_option("shape", edit_.subject,
                     "OFF, OBJ, STL or PLY file, a kind of generated mesh, or half_space")
        ->required()
        ->check(not_empty());
    command->add_option("--name", edit_.name, "name of the obstacle; without it, the daemon chooses one")
        ->check(not_empty("name the obstacle, or leave it out"));
    add_pose(*command);
    command->add_option("--scale", edit_.scale, "metres per mesh unit")->check(number_in_range(1e-9, 1e6));
    command->add_option("--kind", edit_.kind, "surface: an open mesh")->check(one_of({"solid", "surface"}));
    command->add_option("--triangles", edit_.triangles, "approximate number of triangles of a generated mesh")
        ->check(CLI::Range(GeneratedMesh::kMinTriangles, GeneratedMesh::kMaxTriangles));
    command->add_option("--seed", edit_.seed, "seed of a random generated mesh");
    command->add_option("--size", edit_.size_m, "sides X Y Z of a generated box [m]")->expected(1, 3);
    command->add_option("--normal", edit_.normal, "X Y Z: normal out of a half space")->expected(1, 3);
    command->add_option("--offset", edit_.offset_m, "a half space is solid where normal . x < offset [m]");
    std::string kinds = "Kinds of generated meshes:";
    for (const MeshKind& kind : mesh_kinds()) kinds += " " + kind.name;
    command->footer(kinds +
                    "\nExamples:\n  wrenchctl scene add gear --name gear --position 0 0.1 0.02\n"
                    "  wrenchctl scene add half_space --normal 0 0 1 --offset -0.1");
  }

  void add_move(CLI::App& scene) {
    CLI::App* command =
        add(scene, "move", "Move a mesh obstacle to a pose at constant speed; it pushes the tool",
            [this] { run_scene_move(edit_, options_); });
    add_name(*command);
    add_pose(*command);
    command->add_option("--duration", edit_.duration_s, "duration of the motion [s]")
        ->check(number_in_range(1e-3, 86400))
        ->capture_default_str();
  }

  void add_pose(CLI::App& command) {
    command.add_option("--position", edit_.position_m, "X Y Z of the mesh frame in the world [m]")
        ->expected(1, 3);
    CLI::Option* radians =
        command
            .add_option("--rotation", edit_.rotation_rad, "X Y Z: rotation vector, axis times angle [rad]")
            ->expected(1, 3);
    command.add_option("--rotation-deg", edit_.rotation_deg, "the same in degrees")
        ->expected(1, 3)
        ->excludes(radians);
  }

  ControlOptions options_;
  SceneEdit edit_;
};

}  // namespace

std::unique_ptr<Subcommand> make_scene_command() {
  return std::make_unique<SceneCommand>();
}

}  // namespace wrenchd
