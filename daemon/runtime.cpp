// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/runtime.hpp"

#include "config/config_error.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "core/watch_limits.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/recording/recorded_inputs.hpp"

namespace wrenchd {
namespace {

std::filesystem::path named_on_command_line(const std::filesystem::path& name, const SearchPath& search) {
  auto given = std::filesystem::absolute(name);
  std::error_code error;
  if (std::filesystem::exists(given, error)) return given;
  if (const auto found = search.find(name)) return *found;
  throw ConfigError(name, {},
                    search.not_found(name) + ", and from here " + given.lexically_normal().string());
}

/// How often the loop ticks at most: by the clock, or with each report of the device.
double tick_rate_Hz(const RunConfig& plan) {
  const double reports_Hz = plan.profile.report_rate_Hz;
  const double rate_Hz = plan.settings.servo.rate_Hz;
  if (plan.settings.servo.pacing == Pacing::clock || !(reports_Hz > rate_Hz)) return rate_Hz;
  return reports_Hz;
}

/// From when on a loop that says nothing is a stuck one: no late tick takes so long.
Duration silent_after(const ServoSettings& servo) noexcept {
  const int periods = servo.pacing == Pacing::device ? kDeviceTimeout_periods : 1;
  return periods * from_seconds(1.0 / servo.rate_Hz) + kLateTick;
}

}  // namespace

RunConfig load_run_config(const RunConfigFiles& files, const SearchPath& search) {
  RunConfig plan;
  plan.settings = load_settings(named_on_command_line(files.config, search), search);
  if (!files.scene.empty()) plan.settings.scene = named_on_command_line(files.scene, search);
  if (!files.profile.empty()) {
    plan.settings.device.profile = files.profile;
    plan.settings.device.profile_file = files.profile == kAnyProfile
                                            ? std::filesystem::path()
                                            : named_on_command_line(profile_file(files.profile), search);
  }
  if (const auto& file = plan.settings.device.profile_file; !file.empty())
    plan.profile = load_profile(file, search);
  plan.simulated =
      files.simulate || (!plan.profile.name.empty() && plan.profile.transport == Transport::loopback);
  plan.scene = load_scene(plan.settings.scene);
  if (SimulationSettings& simulation = plan.settings.simulation; !simulation.playback.empty())
    simulation.playback_path = read_playback(simulation.playback);
  return plan;
}

LinkSettings link_settings(const RunConfig& plan) {
  const ServoSettings& servo = plan.settings.servo;
  LinkSettings settings = link_settings(plan.profile, silent_after(servo));
  settings.write_deadline =
      kBlockedWrite / 2;  // what is refused for longer is a fault, by the loop's own clock
  settings.priority = servo.realtime == Realtime::off ? 0 : servo.priority;
  return settings;
}

std::unique_ptr<ReconnectingLink> make_plugged_link(const RunConfig& plan) {
  return std::make_unique<ReconnectingLink>(plan.profile, plan.settings.device.serial, link_settings(plan));
}

Runtime::Runtime(RunConfig plan, ReportLink& link, Clock& clock, ProxySearchMode place_in,
                 const MeshLoader& meshes)
    : Runtime(std::move(plan), link, clock, place_in, meshes, meshes) {}

/// The loader that has read the scene is told from a fresh one, by which it is read again.
Runtime::Runtime(RunConfig plan, ReportLink& link, Clock& clock, ProxySearchMode place_in,
                 const MeshLoader& fresh, MeshLoader used)
    : config_(std::move(plan)),
      clock_(clock),
      scene_(std::make_shared<const Scene>(config_.scene, used)),
      mesh_remarks_(used.changes()),
      recorded_texts_(read_recorded_texts(config_)),
      device_(config_.profile, link),
      loop_(config_.settings, config_.profile, device_,
            std::make_unique<Rendering>(0, config_.settings, config_.profile, scene_,
                                        make_proxy_initializer(scene_, place_in)),
            clock),
      reconfigurator_(config_, scene_, loop_, place_in, fresh) {
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
  add_meshes(reconfigurator_.scene(), header);
  set_start_time(clock_, header);
  return header;
}

}  // namespace wrenchd
