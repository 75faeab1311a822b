// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "daemon/hand_scenes.hpp"
#include "daemon/servo/two_loops.hpp"
#include "tests/support/simulated_hand.hpp"

namespace wrenchd::test {

/// Two simulated hands in one world, in virtual time, without a self-test.
struct TwoHands {
  VirtualClock clock;
  std::vector<RunConfig> configs;
  MeshLoader meshes;
  std::array<HandScene, 2> scenes;
  SimulatedHand first, second;
  std::array<SimulatedHand*, 2> hands = {&first, &second};
  std::array<TickRecord, 2> last;  ///< newest record of each hand
  TwoLoops loops;

  /// second_is_there: false if the device of the second hand comes later, by loops.attach().
  explicit TwoHands(std::vector<RunConfig> both, bool second_is_there = true)
      : configs(std::move(both)),
        scenes(make_hand_scenes(configs[0], configs[1], meshes)),
        first(configs[0], clock, ProxySearchMode::in_tick, meshes, scenes[0]),
        second(configs[1], clock, ProxySearchMode::in_tick, meshes, scenes[1]),
        loops(clock.now(), std::chrono::milliseconds(1)) {
    loops.attach(0, first.loop());
    if (second_is_there) loops.attach(1, second.loop());
  }
  TwoHands(const TwoHands&) = delete;
  TwoHands& operator=(const TwoHands&) = delete;

  /// Both configurations of a scene of the gallery.
  static std::vector<RunConfig> gallery(const std::string& name) {
    std::vector<RunConfig> out =
        load_run_configs({source_path("config/gallery/" + name + ".toml"), {}, {}, false},
                         SearchPath({source_path("config")}));
    for (RunConfig& config : out) config.settings.servo.self_test_s = 0.0;
    return out;
  }
  void arm() {
    for (SimulatedHand* hand : hands) hand->loop().requests().arm();
  }
  /// The next tick of either hand.
  void step() {
    loops.step(clock);
    for (std::size_t i = 0; i < hands.size(); ++i) last[i] = hands[i]->newest();
  }
  void run_until(double time_s) {
    while (clock.now() < TimePoint{} + from_seconds(time_s)) step();
  }
};

}  // namespace wrenchd::test
