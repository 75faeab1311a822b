// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "collision/meshes/mesh_loader.hpp"
#include "config/toml_file.hpp"
#include "daemon/run_config.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

/// It cannot be done now, though it may be in a moment: the message says why, and when.
class BusyError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What became of a configuration that was read again.
struct ReloadResult {
  std::vector<std::string> applied;      ///< "wrench.stiffness", ...
  std::vector<std::string> not_applied;  ///< "servo.rate_Hz: takes a restart", ...
  std::vector<std::string> remarks;      ///< of the meshes
};

/// Changes what is rendered while the loop runs. Here it is read, checked, built and warmed up; the loop gets
/// what is ready. Where anything is wrong nothing at all is changed, and the loop never knows of it.
///
/// Any thread but the servo thread, one at a time; meshes may take seconds. What is refused is thrown as
/// ConfigError (place and cure), MeshError, std::invalid_argument or BusyError.
class Reconfigurator {
 public:
  /// plan: what the loop runs with, by whatever was read. scene: what it renders now. loader: kept as it is,
  /// and copied for each reading, so that what is read anew is read. The loop must outlive this.
  Reconfigurator(RunConfig plan, std::shared_ptr<const Scene> scene, ServoLoop& loop,
                 ProxySearchMode place_in, MeshLoader loader);

  // --- the scene ---

  /// Another scene, tool included, from its file. Obstacles that move set out now.
  void replace_scene(const std::filesystem::path& file);
  /// Another obstacle: the table of an [[obstacle]]. source: for messages. Returns its name.
  std::string insert_obstacle(const TomlNode& obstacle, const std::filesystem::path& source);
  void remove_obstacle(const std::string& name);
  /// Lets an obstacle, which has to be a mesh, go to this pose of its mesh frame within so long, on the
  /// straight way, at constant speed. It sets out kMoveDelay_s from now.
  void move_obstacle(const std::string& name, const Pose& X_WO, double over_s);

  /// What [rendering] and [wrench] say, or parts of them. source: for messages.
  void set_rendering(const TomlNode& changes, const std::filesystem::path& source);

  // --- the workspace ---

  void set_scale(double scale);  ///< metres that the tool goes for a metre of the handle
  void set_clutched(bool in);
  void recentre();

  // --- local models ---

  /// What a client knows of the surroundings of the handle, for so long; one of the same id takes the place
  /// of the last.
  void set_model(LocalModel model, double for_s);
  void remove_model(std::uint32_t id);

  // --- all of it ---

  /// Reads the configuration again: all of it is applied that can be, or, where anything in it is refused,
  /// nothing. Limits that are tighter hold at once; those that are looser wait until the loop is disarmed.
  /// What clients changed stays where the files say what they said before. read: the plan, as at the start.
  ReloadResult reload(const std::function<RunConfig()>& read);

  // --- what holds now ---

  Settings settings() const;
  SceneSettings scene() const;
  WorkspaceRequest workspace() const;
  /// Of what was handed over last: its number, and what Rendering::sum() has to be in every tick.
  struct CurrentRendering {
    std::uint32_t id;
    std::uint64_t checksum;
  };
  CurrentRendering current_rendering() const;
  /// What there is to be drawn: the scene that was handed over last, and where and when it is.
  struct SceneView {
    std::shared_ptr<const Scene> scene;
    std::uint32_t rendering_id;   ///< of its rendering
    TimePoint scene_time_begins;  ///< the time of the tick that is scene time 0
    Pose X_WB;                    ///< device base in the world
    Pose X_HT;                    ///< tool body in the handle
    WrenchPoint wrench_point;     ///< what the wrenches in records are about
    ViewSettings viewpoint;       ///< from where it is seen best
  };
  SceneView scene_view();

  /// Names of the obstacles, by their numbers.
  struct ObstacleNames {
    std::uint32_t rendering_id;  ///< number of the one they are of
    std::vector<std::string> names;
  };
  /// Waits for no change that is under way.
  ObstacleNames obstacle_names() const;

  static constexpr double kMoveDelay_s = 0.200;

 private:
  std::string files_fingerprint(const SceneSettings& scene) const;
  double scene_time_s() { return loop_.telemetry().handle_pose().scene_time_s; }
  void wait_until_idle();
  std::shared_ptr<const Scene> build_scene(const SceneSettings& scene);
  std::unique_ptr<Rendering> build_rendering(const Settings& settings, std::shared_ptr<const Scene> scene);
  void offer(std::unique_ptr<Rendering> rendering, const Settings& settings, SceneSettings scene,
             std::shared_ptr<const Scene> built);
  void set_workspace(const WorkspaceRequest& wish);
  LocalModelSet other_models(std::uint32_t id);

  mutable std::mutex mutex_;  ///< of all of the below
  RunConfig config_;          ///< what holds
  Settings file_settings_;    ///< as far as it came from files
  std::string profile_text_;
  std::string scene_fingerprint_;  ///< what the scene's files were when the configuration was read
  std::shared_ptr<const Scene> scene_;
  ServoLoop& loop_;
  ProxySearchMode proxy_search_mode_;
  MeshLoader loader_;
  std::vector<std::string> remarks_;
  std::uint32_t rendering_id_ = 0;
  std::uint64_t checksum_ = 0;
  WorkspaceRequest workspace_;
  LocalModelSet models_;

  mutable std::mutex names_mutex_;  ///< of what is told while a change is under way
  ObstacleNames names_;
};

}  // namespace wrenchd
