// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "collision/meshes/mesh_loader.hpp"
#include "config/rendering_values.hpp"
#include "config/toml_file.hpp"
#include "core/contact_backend.hpp"
#include "daemon/run_config.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

/// The request cannot be done now, but may succeed in a moment. The message says why and when.
class BusyError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Result of a reload.
struct ReloadResult {
  std::vector<std::string> applied;        ///< "wrench.stiffness", ...
  std::vector<std::string> not_applied;    ///< "servo.rate_Hz: requires a restart", ...
  std::vector<std::string> mesh_warnings;  ///< repairs and warnings of the mesh loader
};

/// Changes scene, rendering, workspace, local models and limits while the loop runs.
///
/// Each change is read, checked, built and warmed up on the calling thread; then the loop receives the
/// complete rendering. A change with an error changes nothing: it throws ConfigError (file, line and cure),
/// MeshError, std::invalid_argument or BusyError. With two hands in the process, scene and rendering do not
/// change: these functions throw std::invalid_argument.
///
/// Any thread except the servo thread; calls wait for each other. Not RT-safe: reading meshes may take
/// seconds.
class Reconfigurator {
 public:
  /// config: what the loop runs with. scene: what the loop renders. loader: copied for each scene that is
  /// loaded, so that every mesh file is read again. loaded: has read the present scene; a change of an
  /// obstacle reads only new files. The loop must outlive this object.
  Reconfigurator(RunConfig config, std::shared_ptr<const Scene> scene, ServoLoop& loop,
                 ProxySearchMode proxy_search_mode, MeshLoader loader, MeshLoader loaded);

  // --- Scene ---

  /// Returns where files may be that a client without the right to configure names: the directories of the
  /// search path, of the configuration and of the configured scene.
  FileScope client_scope() const;
  /// Replaces tool and obstacles by those of a scene file. Moving obstacles start now. scope: where the scene
  /// and its meshes may be.
  void replace_scene(const std::filesystem::path& file, const FileScope& scope = {});
  /// Adds an obstacle. obstacle: an [[obstacle]] table. source: file name for error messages. Returns the
  /// name of the obstacle. scope: where its mesh may be.
  std::string insert_obstacle(const TomlNode& obstacle, const std::filesystem::path& source,
                              const FileScope& scope = {});
  void remove_obstacle(const std::string& name);
  /// Moves a mesh obstacle to a pose of its mesh frame O in the world, on a straight path at constant speed.
  /// The motion starts kMoveDelay_s from now and takes duration_s.
  void move_obstacle(const std::string& name, const Pose& X_WO, double duration_s);

  /// Applies keys of [rendering] and [wrench]. source: file name for error messages. Returns what has
  /// changed.
  std::vector<ChangedValue> set_rendering(const TomlNode& changes, const std::filesystem::path& source);

  // --- Workspace ---

  /// scale: displacement of the tool divided by displacement of the handle.
  void set_scale(double scale);
  /// clutched: true disconnects the tool from the handle.
  void set_clutched(bool clutched);
  /// Moves the tool to the pose of the handle.
  void recentre();

  // --- Local models ---

  /// Sets a local model for lifetime_s. Replaces the model that has the same id.
  void set_model(LocalModel model, double lifetime_s);
  void remove_model(std::uint32_t id);

  // --- Reload ---

  /// Reads the configuration by `read` and applies it: all keys that can change at run time, or nothing if
  /// the configuration has an error. Tighter limits apply at once; looser limits only while the loop is
  /// disarmed. A value that a client has changed stays unless the files have changed that key.
  ReloadResult reload(const std::function<RunConfig()>& read);

  // --- Present values ---

  Settings settings() const;
  /// The scene that was offered to the loop last. Returns at once, even while a change is being built.
  struct PresentScene {
    SceneSettings settings;
    std::string text;                          ///< scene file with this content
    std::vector<std::string> obstacle_names;   ///< indexed by obstacle number
    std::uint32_t rendering_id;                ///< rendering that contains the scene
    std::shared_ptr<const MeshLoader> meshes;  ///< the mesh files as they were read
  };
  std::shared_ptr<const PresentScene> present_scene() const;
  /// What detects the contacts of the rendering that was offered last.
  ContactBackend contacts() const noexcept { return contacts_.load(); }
  WorkspaceRequest workspace() const;
  /// The rendering that was offered to the loop last.
  struct CurrentRendering {
    std::uint32_t id;
    std::uint64_t checksum;  ///< equals rendering_checksum of its tick records
  };
  CurrentRendering current_rendering() const;
  /// The scene that was offered to the loop last, for display.
  struct SceneView {
    std::shared_ptr<const Scene> scene;
    std::uint32_t rendering_id;   ///< rendering that contains the scene
    TimePoint scene_time_begins;  ///< time of scene time 0
    Pose X_WB;                    ///< device base in the world
    Pose X_HT;                    ///< tool body in the handle
    WrenchPoint wrench_point;     ///< reference point of the wrenches in tick records
    ViewSettings viewpoint;       ///< camera of the scene
  };
  SceneView scene_view();

  /// Returns the pose of the mesh frame of an obstacle in the world now. obstacle: of the present scene.
  Pose present_pose(const MeshObstacleSettings& obstacle);

  /// Names of the obstacles, indexed by obstacle number.
  struct ObstacleNames {
    std::uint32_t rendering_id;  ///< rendering that contains the obstacles
    std::vector<std::string> names;
  };
  /// Returns at once, as present_scene().
  ObstacleNames obstacle_names() const;

  static constexpr double kMoveDelay_s = 0.200;

 private:
  /// A scene with its meshes, and the repairs and warnings of the mesh loader.
  struct BuiltScene {
    std::shared_ptr<const Scene> scene;
    std::vector<std::string> mesh_warnings;
    std::shared_ptr<const MeshLoader> meshes;  ///< has read the files of the scene
  };
  /// Settings after a reload, and the keys that the files have changed.
  struct ReloadedSettings {
    Settings present;     ///< Values of the loop after the reload.
    Settings from_files;  ///< Values from files after the reload; without those in not_applied.
    bool limits_changed = false;
    bool rendering_changed = false;  ///< True if the change needs a new rendering.
    std::vector<std::string> applied = {};
    std::vector<std::string> not_applied = {};
  };
  /// Scene after a reload.
  struct ReloadedScene {
    bool changed;             ///< True if the name or a file of the scene has changed since the last reload.
    std::string fingerprint;  ///< files_fingerprint() of the scene.
    SceneSettings settings;
    std::string text;  ///< Scene file with this content.
    BuiltScene built;
  };

  void reject_with_two_hands() const;
  void keep_bodies(SceneSettings& scene);
  BuiltScene with_smoothing(SceneSettings& scene, double smoothing_m);
  double scene_time_s() { return loop_.telemetry().handle_pose().scene_time_s; }
  void wait_until_idle();
  static BuiltScene build_scene(const SceneSettings& scene, MeshLoader meshes, const FileScope& scope);
  BuiltScene build_starting_scene(SceneSettings& scene, const FileScope& scope);
  std::unique_ptr<Rendering> build_rendering(const Settings& settings, std::shared_ptr<const Scene> scene);
  void offer(std::unique_ptr<Rendering> rendering, const Settings& settings, SceneSettings scene,
             std::string text, BuiltScene built);
  void set_workspace(const WorkspaceRequest& request);
  LocalModelSet other_models(std::uint32_t id);
  ReloadedSettings reload_settings(const Settings& file) const;
  bool is_profile_changed(const RunConfig& config) const;
  ReloadedScene reload_scene(const SceneSettings& scene);

  mutable std::mutex mutex_;       ///< protects all members but contacts_ and present_
  RunConfig config_;               ///< present values
  Settings file_settings_;         ///< values that came from files; a client may have changed config_ since
  std::string profile_text_;       ///< text of the profile at the start
  std::string scene_fingerprint_;  ///< files_fingerprint() of the scene at the last reload
  std::shared_ptr<const Scene> scene_;
  ServoLoop& loop_;
  ProxySearchMode proxy_search_mode_;
  MeshLoader loader_;
  std::shared_ptr<const MeshLoader> loaded_;  ///< has read the files of scene_
  std::uint32_t rendering_id_ = 0;
  std::uint64_t checksum_ = 0;
  WorkspaceRequest workspace_;
  LocalModelSet models_;
  std::atomic<ContactBackend> contacts_;

  mutable std::mutex present_mutex_;  ///< protects present_; never held while a scene is built
  std::shared_ptr<const PresentScene> present_;
};

}  // namespace wrenchd
