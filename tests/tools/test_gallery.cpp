// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/recording/replay.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/gallery_run.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/gallery.hpp"

namespace wrenchd::test_gallery {

using namespace test;

// Runs every scene of the gallery once through its hand script: no fault, no overlap, and the figures that
// its description states.

namespace {

/// Maximum duration of a script under sanitizers, which are many times slower.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kSeconds = 2.0;
#else
constexpr double kSeconds = 0.0;  // the whole script
#endif

/// Checks in exact arithmetic that the tool overlaps no obstacle, and that free bodies overlap nothing.
class Admissible {
 public:
  explicit Admissible(const SceneSettings& settings) : scene_(settings) {
    for (const MeshObstacle& obstacle : scene_.meshes())
      intersections_.push_back(std::make_unique<ExactIntersection>(scene_.tool_mesh()->surface.mesh(),
                                                                   obstacle.mesh->surface.mesh()));
    for (std::size_t i = 0; i < scene_.bodies().size(); ++i) {
      const TriangleMesh& body = scene_.bodies()[i].body.mesh;
      tool_with_.push_back(std::make_unique<ExactIntersection>(scene_.tool_mesh()->surface.mesh(), body));
      for (std::size_t k = 0; k < scene_.meshes().size(); ++k)
        with_obstacles_.push_back(
            {i, k, std::make_unique<ExactIntersection>(body, scene_.meshes()[k].mesh->surface.mesh())});
      for (std::size_t j = 0; j < i; ++j)
        with_bodies_.push_back(
            {i, j, std::make_unique<ExactIntersection>(body, scene_.bodies()[j].body.mesh)});
    }
  }

  bool bodies_at(const Pose& X_WT, const TickRecord& tick, double scene_time_s) const {
    const auto body = [&](std::size_t i) {
      std::array<double, 7> x{};
      std::copy_n(tick.X_WB.begin() + static_cast<std::ptrdiff_t>(x.size() * i), x.size(), x.begin());
      return pose_from_numbers(x);
    };
    for (std::size_t i = 0; i < tool_with_.size(); ++i)
      if (tool_with_[i]->intersect(inverse(body(i)) * X_WT)) return false;
    for (const Pair& pair : with_obstacles_)
      if (pair.exact->intersect(inverse(scene_.meshes()[pair.b].X_WO_at(scene_time_s)) * body(pair.a)))
        return false;
    return std::none_of(with_bodies_.begin(), with_bodies_.end(), [&](const Pair& pair) {
      return pair.exact->intersect(inverse(body(pair.b)) * body(pair.a));
    });
  }

  bool at(const Pose& X_WT, double scene_time_s) const {
    for (std::size_t k = 0; k < intersections_.size(); ++k)
      if (intersections_[k]->intersect(inverse(scene_.meshes()[k].X_WO_at(scene_time_s)) * X_WT))
        return false;
    for (const HalfSpaceSettings& half_space : scene_.half_spaces())
      for (const Vector3d& p : scene_.tool().hull.vertices_T_m)
        if (half_space.normal_W.dot(X_WT * p) < half_space.offset_m - kRounding_m) return false;
    return true;
  }

 private:
  static constexpr double kRounding_m = 1e-12;  ///< tolerance of half-spaces, which have no clearance
  Scene scene_;
  std::vector<std::unique_ptr<ExactIntersection>> intersections_;
  std::vector<std::unique_ptr<ExactIntersection>> tool_with_;  ///< each body
  struct Pair {
    std::size_t a, b;
    std::unique_ptr<ExactIntersection> exact;
  };
  std::vector<Pair> with_obstacles_, with_bodies_;
};

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const GalleryScene& scene : gallery(SearchPath({test::source_path("config")})))
    all.push_back(scene.name);
  return all;
}

/// Number of poses of a run for the exact test, which is slow for meshes of a hundred thousand triangles.
std::size_t poses_of(const Scene& scene) {
  std::size_t triangles = scene.tool().mesh.triangles.size();
  for (const MeshObstacle& obstacle : scene.meshes()) triangles += obstacle.mesh->surface.triangles().size();
  return triangles > 50'000 ? 60 : 400;
}

void check_scene(const std::string& name) {
  INFO(name);
  const GalleryRun run = run_gallery_scene(name, kSeconds);

  std::size_t proxy_complete = 0;
  for (const TickRecord& tick : run.ticks) {
    if (tick.faults != 0) FAIL("tick " << tick.tick << ": faults " << tick.faults);
    proxy_complete +=
        static_cast<ProxyInitialization>(tick.proxy_initialization) == ProxyInitialization::complete ? 1 : 0;
  }
  CHECK(proxy_complete + 10 > run.ticks.size());
  CHECK(static_cast<State>(run.ticks.back().state) == State::active);

  const Admissible admissible(run.config.scene);
  const std::size_t step = std::max<std::size_t>(1, run.ticks.size() / poses_of(Scene(run.config.scene)));
  std::size_t touching = 0;
  for (std::size_t i = step / 2; i < run.ticks.size(); i += step) {
    if (static_cast<ProxyInitialization>(run.ticks[i].proxy_initialization) != ProxyInitialization::complete)
      continue;
    INFO("tick " << i);
    const Pose X_WQ = pose_from_numbers(run.ticks[i].X_WQ);
    CHECK(admissible.at(X_WQ, run.scene_time_s[i]));
    CHECK(admissible.bodies_at(X_WQ, run.ticks[i], run.scene_time_s[i]));
    touching += run.ticks[i].contacts > 0 ? 1 : 0;
  }

  Recording recording, second;
  recording.ticks = run.ticks;
  second.ticks = run.second_ticks;
  const auto difference = run.config.two_hands()
                              ? replay_two_hands({recording, second}, {run.config, run.second_config})
                              : replay(recording, run.config);
  if (difference) FAIL("replay: tick " << difference->tick << ' ' << difference->field);

  if (kSeconds > 0.0) return;
  CHECK(touching > 10);
  const std::vector<ExpectedFigure> expected = expected_figures(name);
  CHECK(expected.size() >= 6);
  for (const ExpectedFigure& e : expected) {
    INFO(e.quantity << (e.time_s >= 0.0 ? " at " + std::to_string(e.time_s) + " s" : std::string()));
    const double found = run_figure(run, e.quantity, e.time_s);
    CHECK(found >= e.min);
    CHECK(found <= e.max);
  }
}

TEST_CASE("gallery: the cube of the paper", "[gallery]") {
  check_scene("paper_cube");
}
TEST_CASE("gallery: a peg in its hole", "[gallery]") {
  check_scene("peg_in_hole");
}
TEST_CASE("gallery: a key in its lock", "[gallery]") {
  check_scene("key_in_lock");
}
TEST_CASE("gallery: a pair of gears", "[gallery]") {
  check_scene("gear_pair");
}
TEST_CASE("gallery: a bolt and its nut", "[gallery]") {
  check_scene("bolt_and_nut");
}
TEST_CASE("gallery: two hares", "[gallery]") {
  check_scene("hares");
}
TEST_CASE("gallery: a thin plate", "[gallery]") {
  check_scene("thin_plate");
}
TEST_CASE("gallery: a staircase", "[gallery]") {
  check_scene("staircase");
}
TEST_CASE("gallery: an obstacle that moves", "[gallery]") {
  check_scene("moving_obstacle");
}
TEST_CASE("gallery: a box that is pushed over a table", "[gallery]") {
  check_scene("push_the_box");
}
TEST_CASE("gallery: a peg that is put into a loose part", "[gallery]") {
  check_scene("place_the_peg");
}
TEST_CASE("gallery: a plate that two hands carry", "[gallery]") {
  check_scene("carry_the_plate");
}
TEST_CASE("gallery: a stack that is knocked over", "[gallery]") {
  check_scene("knock_the_stack");
}
TEST_CASE("gallery: dominoes", "[gallery]") {
  check_scene("dominoes");
}
TEST_CASE("gallery: a ball in a bowl", "[gallery]") {
  check_scene("ball_in_bowl");
}
TEST_CASE("gallery: a nut that is turned on a bolt", "[gallery]") {
  check_scene("nut_on_bolt");
}
TEST_CASE("gallery: a ratchet", "[gallery]") {
  check_scene("ratchet");
}

TEST_CASE("a recording of a scene with generated meshes replays without other files", "[gallery][program]") {
  const TemporaryDirectory files;
  const std::string file = (files.path() / "run.h5").string();
  const std::string name = GENERATE("staircase", "peg_in_hole");
  REQUIRE(run_program("wrenchd", {"--config", "gallery/" + name + ".toml", "--virtual-time", "--arm",
                                  "--seconds", "3", "--record", file})
              .exit_code == 0);
  const ProgramResult again = run_program("wrenchctl", {"replay", file});
  INFO(again.err);
  CHECK(again.exit_code == 0);
  CHECK(again.out.find("with: the files in the recording") != std::string::npos);
  CHECK(again.out.find("3001 ticks, all bits are equal") != std::string::npos);
}

TEST_CASE("every gallery scene has a description, a repeating script, a viewpoint and a test", "[gallery]") {
  const std::vector<std::string> all = names();
  CHECK(all == std::vector<std::string>{
                   "ball_in_bowl", "bolt_and_nut", "carry_the_plate", "dominoes", "gear_pair", "hares",
                   "key_in_lock", "knock_the_stack", "moving_obstacle", "nut_on_bolt", "paper_cube",
                   "peg_in_hole", "place_the_peg", "push_the_box", "ratchet", "staircase", "thin_plate"});
  for (const std::string& name : all) {
    INFO(name);
    const RunConfig plan = gallery_config(name);
    CHECK(plan.settings.description.size() > 200);
    CHECK(plan.settings.simulation.hand_repeats);
    CHECK(plan.settings.wrench.law == SpringLaw::energy);
    CHECK((plan.settings.view.eye_m - plan.settings.view.target_m).norm() > 0.05);
    CHECK_FALSE(expected_figures(name).empty());
  }
}

TEST_CASE("wrenchctl gallery lists the scenes, and shows one", "[gallery][wrenchctl]") {
  const ProgramResult list = run_program("wrenchctl", {"gallery"});
  CHECK(list.exit_code == 0);
  for (const std::string& name : names()) CHECK_THAT(list.out, Catch::Contains(name + " "));
  CHECK_THAT(list.out, Catch::Contains("peg_in_hole      A peg of 19.8 mm for a hole of 20 mm.\n"));

  const ProgramResult one = run_program("wrenchctl", {"gallery", "staircase"});
  CHECK(one.exit_code == 0);
  CHECK_THAT(one.out, Catch::Contains("wrenchd --arm --live --config gallery/staircase.toml"));
  CHECK_THAT(one.out, Catch::Contains("tools/run staircase"));

  const ProgramResult near = run_program("wrenchctl", {"gallery", "stair_case"});
  CHECK(near.exit_code == 1);
  CHECK_THAT(near.err, Catch::Contains("there is no 'stair_case'; did you mean 'staircase'?"));
  const ProgramResult none = run_program("wrenchctl", {"gallery", "teapot"});
  CHECK(none.exit_code == 1);
  CHECK_THAT(none.err, Catch::Contains("there are ball_in_bowl, bolt_and_nut, carry_the_plate"));
}

TEST_CASE("tools/run rejects an unknown gallery name with the list of names", "[gallery]") {
  const ProgramResult result = run_program("../../../tools/run", {"teapot"});
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Catch::Contains("the gallery has no scene 'teapot'; the scenes are ball_in_bowl"));
}

}  // namespace
}  // namespace wrenchd::test_gallery
