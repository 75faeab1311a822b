// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/hand_scenes.hpp"
#include "daemon/servo/two_loops.hpp"
#include "devices/links/simulated_link.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test {

/// One of two simulated hands in virtual time.
struct VirtualHand {
  std::unique_ptr<SimulatedLink> link;
  std::unique_ptr<Runtime> runtime;
  TickRecord last;

  VirtualHand(const RunConfig& config, Clock& clock, const MeshLoader& meshes, const HandScene& scene)
      : link(make_simulated_link(config.profile, config.settings.simulation, clock)),
        runtime(std::make_unique<Runtime>(config, *link, clock, ProxySearchMode::in_tick, meshes, scene)) {
    runtime->open();
  }
  ServoLoop& loop() const { return runtime->loop(); }
  State state() const { return static_cast<State>(last.state); }
  /// Force on the hand in the world [N]: the base is parallel to it.
  Vector3d force_N() const { return {last.F_out[0], last.F_out[1], last.F_out[2]}; }
  Vector3d tool_m() const { return {last.X_WQ[0], last.X_WQ[1], last.X_WQ[2]}; }
};

/// Two hands in one world, in virtual time, without a self-test.
struct TwoHands {
  VirtualClock clock;
  std::vector<RunConfig> configs;
  std::array<HandScene, 2> scenes;
  std::vector<VirtualHand> hands;
  TwoLoops loops;

  /// second_is_there: false if the device of the second hand comes later, by loops.attach().
  explicit TwoHands(std::vector<RunConfig> both, bool second_is_there = true)
      : configs(std::move(both)), loops(clock.now(), std::chrono::milliseconds(1)) {
    MeshLoader meshes;
    scenes = make_hand_scenes(configs[0], configs[1], meshes);
    for (std::size_t i = 0; i < 2; ++i) hands.emplace_back(configs[i], clock, meshes, scenes[i]);
    for (std::size_t i = 0; i < (second_is_there ? 2U : 1U); ++i) loops.attach(i, hands[i].loop());
  }
  /// Both configurations of a scene of the gallery.
  static std::vector<RunConfig> gallery(const std::string& name) {
    std::vector<RunConfig> out =
        load_run_configs({source_path("config/gallery/" + name + ".toml"), {}, {}, false},
                         SearchPath({source_path("config")}));
    for (RunConfig& config : out) config.settings.servo.self_test_s = 0.0;
    return out;
  }
  void arm() {
    for (VirtualHand& hand : hands) hand.loop().requests().arm();
  }
  void step() {
    loops.step(clock);
    for (VirtualHand& hand : hands) hand.loop().telemetry().latest_record().read(hand.last);
  }
  void run_until(double time_s) {
    while (clock.now() < TimePoint{} + from_seconds(time_s)) step();
  }
  Vector3d plate_m() const { return {hands[0].last.X_WB[0], hands[0].last.X_WB[1], hands[0].last.X_WB[2]}; }
  std::uint8_t held(std::size_t i) const { return static_cast<std::uint8_t>(hands[i].loop().held_body()); }
};

}  // namespace wrenchd::test
