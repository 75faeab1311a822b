// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "collision/scene.hpp"
#include "config/search_path.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "daemon/control/reconfigurator.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "devices/links/reconnecting_link.hpp"
#include "devices/links/report_link.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// What a command line names: the configuration, and what stands in place of what the configuration names. A
/// file is taken as it is given, from the working directory, and then looked for along the search path.
struct RunConfigFiles {
  std::filesystem::path config = "wrenchd.toml";
  std::filesystem::path scene;  ///< empty: the configuration's
  std::string profile;          ///< name or file; empty: the configuration's
  bool simulate = false;        ///< whatever the profile's transport is
};

/// Reads the configuration, its scene and its profile. Throws ConfigError.
RunConfig load_run_config(const RunConfigFiles& files, const SearchPath& search);

/// Of any link that has a thread of its own: how long its writes may take, and when a loop that is silent is
/// spoken for.
LinkSettings link_settings(const RunConfig& plan);

/// The link to the plugged-in device that the plan wants, not opened.
std::unique_ptr<ReconnectingLink> make_plugged_link(const RunConfig& plan);

/// The parts of one running wrenchd, built from a plan in the order in which they need each other.
class Runtime {
 public:
  /// Link and clock must outlive this. meshes: reads those of the scene; its changes and remarks are kept.
  /// Throws MeshError, std::runtime_error.
  Runtime(RunConfig plan, ReportLink& link, Clock& clock,
          ProxySearchMode place_in = ProxySearchMode::background, const MeshLoader& meshes = {});
  ~Runtime();
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  const RunConfig& config() const noexcept { return config_; }
  const Scene& scene() const noexcept { return *scene_; }  ///< of the start
  /// What a person should know of the meshes of the scene, a sentence each.
  const std::vector<std::string>& mesh_remarks() const noexcept { return mesh_remarks_; }
  /// Opens the device, closing it first where it was open: before the loop runs, and after each fault. The
  /// loop is disarmed then, as release() leaves it. Throws as the link does. No servo thread may run.
  void open() { device_.open(); }
  void close() noexcept { device_.close(); }
  /// The device, for its homing; only while no servo thread runs.
  ProfileDevice& device() noexcept { return device_; }
  ServoLoop& loop() noexcept { return loop_; }
  /// Where what is rendered is changed while the loop runs.
  Reconfigurator& reconfigurator() noexcept { return reconfigurator_; }
  /// Shows every tick to recorders and to other processes from now on. First before the loop runs; when
  /// called again, the same. Throws std::system_error.
  SharedState& enable_shared_state();

  /// What a recording of this station must know, that begins now. Reads its mesh files.
  RecordingHeader recording_header() const;

 private:
  RunConfig config_;
  const Clock& clock_;
  std::shared_ptr<const Scene> scene_;
  std::vector<std::string> mesh_remarks_;
  RecordingHeader recorded_texts_;  ///< as they were read: files may change while the loop runs
  ProfileDevice device_;
  std::unique_ptr<SharedState> shared_state_;
  ServoLoop loop_;
  Reconfigurator reconfigurator_;

  Runtime(RunConfig plan, ReportLink& link, Clock& clock, ProxySearchMode place_in, const MeshLoader& fresh,
          MeshLoader used);
};

}  // namespace wrenchd
