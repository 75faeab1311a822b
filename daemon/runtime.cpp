// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/runtime.hpp"

#include <optional>
#include <utility>

#include "config/config_error.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "config/near_file.hpp"
#include "config/scene_text.hpp"
#include "config/second_hand.hpp"
#include "core/files/absolute_name.hpp"
#include "core/watch_limits.hpp"
#include "daemon/hand_file.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/recording/recorded_inputs.hpp"

namespace wrenchd {
namespace {

/// Returns the file in the working directory, else in the search path. Throws ConfigError if there is none.
std::filesystem::path find_file(const std::filesystem::path& name, const SearchPath& search) {
  const std::filesystem::path given = absolute_name(name);
  std::error_code error;
  if (std::filesystem::exists(given, error)) return given;
  if (const auto found = search.find(name)) return *found;
  const std::filesystem::path near = near_file(name);
  throw ConfigError(name, {},
                    search.searched(name) + ", and from here " + given.string() +
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

/// Reads the scene and the profile of a hand.
RunConfig complete(Settings settings, const RunConfigFiles& files, const SearchPath& search) {
  RunConfig config;
  config.settings = std::move(settings);
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

/// Returns true if nothing in the configuration keeps two hands from opening the same real device.
bool may_open_same_device(const RunConfig& a, const RunConfig& b) {
  const DeviceSettings& one = a.settings.device;
  const DeviceSettings& other = b.settings.device;
  if (a.simulated || b.simulated) return false;
  if (one.profile != other.profile && one.profile != kAnyProfile && other.profile != kAnyProfile)
    return false;
  const auto names_device = [](const DeviceSettings& device) {
    return !device.serial.empty() || !device.usb_port.empty();
  };
  return !names_device(one) || !names_device(other) ||
         (one.serial == other.serial && one.usb_port == other.usb_port);
}

}  // namespace

std::vector<RunConfig> load_run_configs(const RunConfigFiles& files, const SearchPath& search) {
  const std::filesystem::path file = find_file(files.config, search);
  std::optional<SecondHand> second;
  std::vector<RunConfig> hands;
  hands.push_back(complete(load_settings(file, search, &second), files, search));
  if (!second) return hands;
  RunConfigFiles files_of_second = files;
  if (second->names_profile) files_of_second.profile.clear();
  hands.push_back(complete(std::move(second->settings), files_of_second, search));
  RunConfig& first = hands.front();
  RunConfig& other = hands.back();
  if (second->tool) {
    other.scene.tool = *second->tool;
    other.scene.text = scene_text(other.scene, 0.0);
  }
  if (may_open_same_device(first, other))
    throw ConfigError(file, second->location,
                      "both hands may use the same device: state serial or usb_port in [device] and in "
                      "[hand.device], or another profile for one of them");
  other.is_second = true;
  for (RunConfig& hand : hands) hand.second_hand = second->name;
  other.settings.recording.file = file_of_hand(other.settings.recording.file, second->name);
  return hands;
}

RunConfig load_run_config(const RunConfigFiles& files, const SearchPath& search) {
  return std::move(load_run_configs(files, search).front());
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

void Runtime::set_arming_obstacle(std::string reason) {
  loop_.requests().permit_arming(reason.empty());
  const std::lock_guard lock(obstacle_mutex_);
  arming_obstacle_ = std::move(reason);
}

std::string Runtime::arming_obstacle() const {
  const std::lock_guard lock(obstacle_mutex_);
  return arming_obstacle_;
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
