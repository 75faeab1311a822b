// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/control/json_rpc.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd {

// wrenchctl scene: shows and changes the scene of a running daemon.

/// An obstacle to add, or the pose to move one to. Vectors are the words of the command line: three numbers,
/// in one word separated by commas, or in three words.
struct SceneEdit {
  std::string subject;  ///< load: file; add: file, kind of a generated mesh or half_space; else: obstacle
  std::string name;     ///< name of an added obstacle; empty: the daemon chooses it
  std::vector<std::string> position_m;
  std::vector<std::string> rotation_rad;  ///< rotation vector
  std::vector<std::string> rotation_deg;  ///< the same in degrees; excludes rotation_rad
  std::vector<std::string> normal;        ///< of a half space
  std::vector<std::string> size_m;        ///< of a generated box
  std::optional<double> offset_m;         ///< of a half space
  std::optional<double> scale;
  std::optional<std::int64_t> triangles, seed;  ///< of a generated mesh
  std::string kind;                             ///< solid or surface; empty: solid
  double duration_s = 1.0;                      ///< of a motion
};

/// Returns three numbers. option: for messages. Throws std::runtime_error.
std::vector<double> vector_of(const std::vector<std::string>& words, const std::string& option);

/// Returns the obstacle table for scene.add. A file name is resolved in the working directory, then on the
/// search path. Throws std::runtime_error that names the argument and the cure.
Json obstacle_request(const SceneEdit& edit);

/// Returns the scene as a table, one line a body. scene: result of scene.get.
std::string scene_list_text(const Json& scene);

// The commands. Not RT-safe: each waits for the daemon.

void run_scene_list(const ControlOptions& options);
void run_scene_load(const SceneEdit& edit, const ControlOptions& options);
/// Loads the file of the present scene again, so that added, moved and removed obstacles are as in the file.
void run_scene_reset(const ControlOptions& options);
void run_scene_add(const SceneEdit& edit, const ControlOptions& options);
void run_scene_move(const SceneEdit& edit, const ControlOptions& options);
void run_scene_remove(const SceneEdit& edit, const ControlOptions& options);

}  // namespace wrenchd
