// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/gallery_run.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_grasp_requests {

using namespace test;

// The tool holds a free body on request, or while a button is pressed, and reports it by events.

namespace {

struct GraspEvent {
  std::uint32_t body;
  bool held, broke;
  bool operator==(const GraspEvent&) const = default;
};

/// The scene place_the_peg. The hand goes to the peg and lifts it; a button that the script presses is
/// removed.
struct Peg {
  VirtualRuntime s;
  std::vector<GraspEvent> events;

  explicit Peg(double strength_N = 20.0) : s(config(strength_N)) {
    s.tick();
    s.runtime.loop().requests().arm();
  }
  static RunConfig config(double strength_N) {
    RunConfig config = gallery_config("place_the_peg");
    config.settings.rendering.grasp.force_N = strength_N;
    for (Waypoint& waypoint : config.settings.simulation.hand_path) waypoint.grasp = false;
    return config;
  }
  RequestInbox& requests() { return s.runtime.loop().requests(); }
  void run_until(double time_s) {
    while (static_cast<double>(s.last.tick) < 1000.0 * time_s) {
      const auto before = s.last.F_out;
      s.tick();
      const Vector3d change_N(s.last.F_out[0] - before[0], s.last.F_out[1] - before[1],
                              s.last.F_out[2] - before[2]);
      largest_change_N = std::max(largest_change_N, change_N.norm());
      for (Event event; s.runtime.loop().telemetry().events().pop(event);) {
        if (const auto* grasped = std::get_if<Event::Grasped>(&event.data))
          events.push_back({grasped->body, true, false});
        if (const auto* let_go = std::get_if<Event::LetGo>(&event.data))
          events.push_back({let_go->body, false, let_go->broke});
      }
    }
  }
  double peg_z_m() const { return s.last.X_WB[2]; }
  double largest_change_N = 0.0;  ///< Largest change of the force in one tick.
};

TEST_CASE("the tool holds the body that it touches when asked, and lets go without a jump",
          "[grasp_requests]") {
  Peg peg;
  peg.run_until(2.4);
  peg.requests().grasp();
  peg.run_until(4.6);
  CHECK(peg.events == std::vector<GraspEvent>{{1, true, false}});
  CHECK(peg.peg_z_m() > 0.09);
  // The weight of 60 g pulls the hand down.
  CHECK(peg.s.last.F_out[2] == Approx(-0.06 * 9.81).epsilon(0.05));
  peg.largest_change_N = 0.0;
  peg.requests().let_go();
  peg.run_until(4.9);
  CHECK(peg.events == std::vector<GraspEvent>{{1, true, false}, {1, false, false}});
  CHECK(peg.peg_z_m() < 0.09);
  CHECK(peg.largest_change_N < 0.02);
  CHECK(std::abs(peg.s.last.F_out[2]) < 0.01);
}

TEST_CASE("a grasp that was asked for in the air takes the first body that the tool touches",
          "[grasp_requests]") {
  Peg peg;
  peg.run_until(1.0);
  peg.requests().grasp();
  peg.run_until(1.5);
  CHECK(peg.events.empty());
  peg.run_until(4.6);
  CHECK(peg.events == std::vector<GraspEvent>{{1, true, false}});
  CHECK(peg.peg_z_m() > 0.09);
}

TEST_CASE("a grasp that broke is not taken again until it is asked for again", "[grasp_requests]") {
  Peg peg(0.3);  // less than the weight
  peg.run_until(2.4);
  peg.requests().grasp();
  peg.run_until(9.8);  // the hand comes back to the height of the peg
  CHECK(peg.events.size() == 2);
  CHECK(peg.events.back() == GraspEvent{1, false, true});
  CHECK(peg.peg_z_m() < 0.04);
}

}  // namespace
}  // namespace wrenchd::test_grasp_requests
