// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "collision/scene.hpp"
#include "config/search_path.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "daemon/control/reconfigurator.hpp"
#include "daemon/hand_scenes.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "devices/links/reconnecting_link.hpp"
#include "devices/links/report_link.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// The files that a command line names. A relative path starts at the working directory; if no such file
/// exists there, it starts at each directory of the search path.
struct RunConfigFiles {
  std::filesystem::path config = "wrenchd.toml";
  std::filesystem::path scene;  ///< empty: the scene of the configuration
  std::string profile;          ///< name or file; empty: the profile of the configuration
  bool simulate = false;        ///< simulate the device, whatever transport its profile has
};

/// Reads the configuration, its scene and its profile, for the first hand and, if the configuration has a
/// [[hand]], for the second one. `files` apply to both hands; a profile does not replace one that [[hand]]
/// names. Throws ConfigError. Not RT-safe: reads files.
std::vector<RunConfig> load_run_configs(const RunConfigFiles& files, const SearchPath& search);
/// Returns the first of load_run_configs().
RunConfig load_run_config(const RunConfigFiles& files, const SearchPath& search);

/// Returns the settings of a link with a writer thread: write deadline, and the time after which the thread
/// sends a zero wrench because the loop has sent no command. Not RT-safe: allocates.
LinkSettings link_settings(const RunConfig& config);

/// Returns the link to the connected device that the configuration selects. The link is not open. Not
/// RT-safe: allocates.
std::unique_ptr<ReconnectingLink> make_plugged_link(const RunConfig& config);

/// The parts of one running wrenchd, built from a run configuration: scene, device, servo loop and
/// reconfigurator. Not RT-safe.
class Runtime {
 public:
  /// Link and clock must outlive this object. meshes: loader of the scene's meshes. hand: one of two, whose
  /// scene `meshes` has read. Throws MeshError, std::runtime_error. May take seconds: reads meshes.
  Runtime(RunConfig config, ReportLink& link, Clock& clock,
          ProxySearchMode search_mode = ProxySearchMode::background, const MeshLoader& meshes = {},
          const HandScene& hand = {});
  ~Runtime();
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  const RunConfig& config() const noexcept { return config_; }
  /// Scene at the start. The reconfigurator has the current scene.
  const Scene& scene() const noexcept { return *scene_; }
  /// Repairs and warnings of the mesh loader, a sentence each.
  const std::vector<std::string>& mesh_remarks() const noexcept { return mesh_remarks_; }
  /// Opens the device, after closing it if it is open. Call it before the loop runs and after each loss of
  /// the device. The loop is disarmed afterwards. Throws as the link does. Precondition: no servo thread
  /// ticks this loop.
  void open() { device_.open(); }
  void close() noexcept { device_.close(); }
  /// The device, for homing. Precondition: no servo thread runs.
  ProfileDevice& device() noexcept { return device_; }
  ServoLoop& loop() noexcept { return loop_; }
  /// If the reason is not empty, no client, button or option of the command line can arm the loop. The reason
  /// ends with a remedy. An empty reason permits arming. Any thread.
  void set_arming_obstacle(std::string reason);
  /// Returns the reason of set_arming_obstacle(). Any thread.
  std::string arming_obstacle() const;
  /// Changes scene, rendering and limits while the loop runs.
  Reconfigurator& reconfigurator() noexcept { return reconfigurator_; }
  /// Creates the shared memory that publishes every tick to recorders and other processes. The first call
  /// must precede the loop; later calls return the same memory. Throws std::system_error.
  SharedState& enable_shared_state();

  /// Returns the header of a recording that begins now, with the present scene. Reads the mesh files. Does
  /// not wait while another scene is being built.
  RecordingHeader recording_header() const;

 private:
  RunConfig config_;
  const Clock& clock_;
  std::shared_ptr<const Scene> scene_;
  std::vector<std::string> mesh_remarks_;
  RecordingHeader recorded_texts_;  ///< texts of the files at the start, except the scene's
  ProfileDevice device_;
  std::unique_ptr<SharedState> shared_state_;
  mutable std::mutex obstacle_mutex_;
  std::string arming_obstacle_;  ///< protected by obstacle_mutex_
  ServoLoop loop_;
  Reconfigurator reconfigurator_;

  Runtime(RunConfig config, ReportLink& link, Clock& clock, ProxySearchMode search_mode,
          const MeshLoader& fresh, MeshLoader used, const HandScene& hand);
};

}  // namespace wrenchd
