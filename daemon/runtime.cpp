// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/runtime.hpp"

#include "config/config_error.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "config/near_file.hpp"
#include "core/watch_limits.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/recording/recorded_inputs.hpp"

namespace wrenchd {
namespace {

/// Returns the file in the working directory, else in the search path. Throws ConfigError if there is none.
std::filesystem::path find_file(const std::filesystem::path& name, const SearchPath& search) {
  auto given = std::filesystem::absolute(name);
  std::error_code error;
  if (std::filesystem::exists(given, error)) return given;
  if (const auto found = search.find(name)) return *found;
  const std::filesystem::path near = near_file(name);
  throw ConfigError(name, {},
                    search.searched(name) + ", and from here " + given.lexically_normal().string() +
                        (near.empty() ? search.advice(name) : "; did you mean '" + near.string() + "'?"));
}

/// Returns the highest tick rate: the configured rate, or the report rate if each report starts a tick.
double tick_rate_Hz(const RunConfig& config) {
  const double reports_Hz = config.profile.report_rate_Hz;
  const double rate_Hz = config.settings.servo.rate_Hz;
  if (config.settings.servo.pacing == Pacing::clock || !(reports_Hz > rate_Hz)) return rate_Hz;
  return reports_Hz;
}

/// Returns the time without a command after which the loop counts as stalled. It exceeds the longest late
/// tick.
Duration stall_timeout(const ServoSettings& servo) noexcept {
  const int periods = servo.pacing == Pacing::device ? kDeviceTimeout_periods : 1;
  return periods * from_seconds(1.0 / servo.rate_Hz) + kLateTick;
}

}  // namespace

RunConfig load_run_config(const RunConfigFiles& files, const SearchPath& search) {
  RunConfig config;
  config.settings = load_settings(find_file(files.config, search), search);
  if (!files.scene.empty()) config.settings.scene = find_file(files.scene, search);
  if (!files.profile.empty()) {
    config.settings.device.profile = files.profile;
    config.settings.device.profile_file = files.profile == kAnyProfile
                                              ? std::filesystem::path()
                                              : find_file(profile_file(files.profile), search);
  }
  if (const auto& file = config.settings.device.profile_file; !file.empty())
    config.profile = load_profile(file, search, &config.profile_texts);
  config.simulated =
      files.simulate || (!config.profile.name.empty() && config.profile.transport == Transport::loopback);
  config.scene = load_scene(config.settings.scene);
  config.scene.smoothing_m = config.settings.rendering.smoothing_m;
  if (SimulationSettings& simulation = config.settings.simulation; !simulation.playback.empty())
    simulation.playback_path = read_playback(simulation.playback);
  return config;
}

LinkSettings link_settings(const RunConfig& config) {
  const ServoSettings& servo = config.settings.servo;
  LinkSettings settings = link_settings(config.profile, stall_timeout(servo));
  settings.write_deadline = kBlockedWrite / 2;  // the loop raises a fault after kBlockedWrite
  settings.priority = servo.realtime == Realtime::off ? 0 : servo.priority;
  return settings;
}

std::unique_ptr<ReconnectingLink> make_plugged_link(const RunConfig& config) {
  const DeviceSettings& device = config.settings.device;
  return std::make_unique<ReconnectingLink>(config.profile, device.serial, link_settings(config),
                                            device.usb_port);
}

Runtime::Runtime(RunConfig config, ReportLink& link, Clock& clock, ProxySearchMode search_mode,
                 const MeshLoader& meshes, const HandScene& hand)
    : Runtime(std::move(config), link, clock, search_mode, meshes, meshes, hand) {}

/// `used` reads the scene and keeps the warnings and the files. `fresh` has read nothing: the reconfigurator
/// copies it for each scene that is loaded.
Runtime::Runtime(RunConfig config, ReportLink& link, Clock& clock, ProxySearchMode search_mode,
                 const MeshLoader& fresh, MeshLoader used, const HandScene& hand)
    : config_(std::move(config)),
      clock_(clock),
      scene_(hand.scene ? hand.scene : std::make_shared<const Scene>(config_.scene, used)),
      mesh_remarks_(used.changes()),
      recorded_texts_(read_recorded_texts(config_)),
      device_(config_.profile, link),
      loop_(config_.settings, config_.profile, device_,
            std::make_unique<Rendering>(
                0, config_.settings, config_.profile, scene_,
                make_proxy_initializer(scene_, search_mode, config_.settings.rendering.contacts), hand.tool),
            clock),
      reconfigurator_(config_, scene_, loop_, search_mode, fresh, used) {
  mesh_remarks_.insert(mesh_remarks_.end(), used.warnings().begin(), used.warnings().end());
}

Runtime::~Runtime() {
  device_.close();
}

SharedState& Runtime::enable_shared_state() {
  if (shared_state_) return *shared_state_;
  shared_state_ = std::make_unique<SharedState>(tick_rate_Hz(config_));
  loop_.telemetry().publish_to(*shared_state_);
  return *shared_state_;
}

RecordingHeader Runtime::recording_header() const {
  RecordingHeader header = recorded_texts_;
  header.rate_Hz = tick_rate_Hz(config_);
  const auto scene = reconfigurator_.present_scene();
  header.scene = scene->text;
  header.scene_file = scene->settings.file;
  add_meshes(scene->settings, *scene->meshes, header);
  set_start_time(clock_, header);
  return header;
}

}  // namespace wrenchd
