// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "daemon/runtime.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "devices/links/simulated_link.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test {

/// The shipped configuration with the emulator of `profile`, whose handle moves as prescribed: no force
/// changes the motion. Without self-test.
inline RunConfig prescribed_motion(const std::string& profile, const std::function<Pose(double t_s)>& X_BH,
                                   double duration_s) {
  RunConfig config = load_run_config({source_path("config/wrenchd.toml"), {}, profile, true},
                                     SearchPath({source_path("config")}));
  config.settings.servo.self_test_s = 0.0;
  SimulationSettings& simulation = config.settings.simulation;
  simulation.playback_path.clear();
  for (double t_s = 0.0; t_s <= duration_s; t_s += 0.002)
    simulation.playback_path.push_back({t_s, X_BH(t_s)});
  simulation.playback_mode = PlaybackMode::open;
  return config;
}

/// A servo loop with an emulated device whose handle moves as prescribed, in virtual time.
struct EmulatedRun {
  static constexpr double kPeriod_s = 1e-3;

  explicit EmulatedRun(const RunConfig& config)
      : link(make_simulated_link(config.profile, config.settings.simulation, clock)),
        runtime(config, *link, clock, ProxySearchMode::in_tick) {
    runtime.open();
  }
  void tick() {
    const Vector3d before_m = link->device().X_BH().translation_m;
    clock.sleep_until(clock.now() + from_seconds(kPeriod_s));
    runtime.loop().tick(clock.now(), clock.now());
    runtime.loop().telemetry().latest_record().read(record);
    true_velocity_m_per_s = (link->device().X_BH().translation_m - before_m) / kPeriod_s;
  }
  void run_until(
      double t_s, const std::function<void()>& each = [] {}) {
    while (seconds(clock.now().time_since_epoch()) < t_s) {
      tick();
      each();
    }
  }
  void arm() { runtime.loop().requests().arm(); }
  void set_model(const LocalModel& model) {
    LocalModelSet set;
    set.add(model);
    runtime.loop().requests().set_local_models(set);
  }
  State state() const { return static_cast<State>(record.state); }
  Vector3d force_N() const { return {record.F_out[0], record.F_out[1], record.F_out[2]}; }

  VirtualClock clock;
  std::unique_ptr<SimulatedLink> link;
  Runtime runtime;
  TickRecord record;
  Vector3d true_velocity_m_per_s = Vector3d::Zero();
};

}  // namespace wrenchd::test
