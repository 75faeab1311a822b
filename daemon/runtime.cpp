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
double tick_rate_Hz(const Plan& plan) {
  const double reports_Hz = plan.profile.report_rate_Hz;
  const double rate_Hz = plan.settings.servo.rate_Hz;
  if (plan.settings.servo.pacing == Pacing::clock || !(reports_Hz > rate_Hz)) return rate_Hz;
  return reports_Hz;
}

/// From when on a loop that says nothing is a stuck one: no late tick takes so long.
Duration silent_after(const ServoSettings& servo) noexcept {
  const int periods = servo.pacing == Pacing::device ? kDevicePatience_periods : 1;
  return periods * from_seconds(1.0 / servo.rate_Hz) + kLateTick;
}

}  // namespace

Plan read_plan(const PlanFiles& files, const SearchPath& search) {
  Plan plan;
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

LinkSettings link_settings(const Plan& plan) {
  const ServoSettings& servo = plan.settings.servo;
  LinkSettings settings = link_settings(plan.profile, silent_after(servo));
  settings.write_deadline =
      kBlockedWrite / 2;  // what is refused for longer is a fault, by the loop's own clock
  settings.priority = servo.realtime == Realtime::off ? 0 : servo.priority;
  return settings;
}

std::unique_ptr<PluggedLink> make_plugged_link(const Plan& plan) {
  return std::make_unique<PluggedLink>(plan.profile, plan.settings.device.serial, link_settings(plan));
}

Station::Station(Plan plan, ReportLink& link, Clock& clock, PlaceIn place_in, const MeshLoader& meshes)
    : Station(std::move(plan), link, clock, place_in, meshes, meshes) {}

/// The loader that has read the scene is told from a fresh one, by which it is read again.
Station::Station(Plan plan, ReportLink& link, Clock& clock, PlaceIn place_in, const MeshLoader& fresh,
                 MeshLoader used)
    : plan_(std::move(plan)),
      clock_(clock),
      scene_(std::make_shared<const Scene>(plan_.scene, used)),
      mesh_remarks_(used.changes()),
      texts_(recorded_texts(plan_)),
      device_(plan_.profile, link),
      loop_(plan_.settings, plan_.profile, device_,
            std::make_unique<Rendering>(0, plan_.settings, plan_.profile, scene_,
                                        make_placer(scene_, place_in)),
            clock),
      workbench_(plan_, scene_, loop_, place_in, fresh) {
  mesh_remarks_.insert(mesh_remarks_.end(), used.remarks().begin(), used.remarks().end());
}

Station::~Station() {
  device_.close();
}

SharedState& Station::show_state() {
  if (shared_state_) return *shared_state_;
  shared_state_ = std::make_unique<SharedState>(tick_rate_Hz(plan_));
  loop_.show_in(*shared_state_);
  return *shared_state_;
}

RecordingHeader Station::recording_header() const {
  RecordingHeader header = texts_;
  header.rate_Hz = tick_rate_Hz(plan_);
  add_meshes(workbench_.scene(), header);
  begin_now(clock_, header);
  return header;
}

}  // namespace wrenchd
