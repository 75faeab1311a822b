// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/random_values.hpp"

// Random scenes of free bodies, with and without a hand: nothing overlaps in exact arithmetic, and the bodies
// gain no energy but from the tool and from gravity. core/METHOD.md, section 15.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

constexpr double kTick_s = 1e-3;
constexpr double kMostGain_J_per_s = 1e-6;
constexpr int kReturn_ticks = 200;  // after a grasp, the tool is back at the hand by then
constexpr double kFloor_m = 0.3;    // side of the plate

struct Options {
  long scenes = 20;
  std::uint64_t seed = 1;
  double seconds = 1.0;
  int overlap_ticks = 20;  ///< ticks between two tests of all pairs in exact arithmetic
  bool grasps = false;     ///< the hand holds bodies and lets go of them
  bool verbose = false;
};

struct Totals {
  long scenes = 0, grasps = 0, ticks = 0, unfinished = 0, poses = 0, overlaps = 0, violations = 0;
  double worst_gain_J_per_s = 0.0;
  std::vector<double> tick_us;
};

double thread_time_us() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

TriangleMesh random_mesh(RandomValues& random) {
  const auto seed = static_cast<std::uint32_t>(random.integer(1, 1000));
  switch (random.integer(0, 3)) {
    case 0: {
      GeneratedMesh box{"box", 12, 1, {}};
      for (double& side : box.size_m) side = random.uniform(0.01, 0.06);
      return make_mesh(box);
    }
    case 1:
      return make_mesh({"boulder", static_cast<std::size_t>(random.integer(50, 400)), seed, {}});
    case 2:
      return make_mesh({"sphere", static_cast<std::size_t>(random.integer(80, 400)), seed, {}});
    default:
      return make_mesh({"gear", 600, seed, {}});
  }
}

/// A scene of 1 to 6 bodies above a plate, and its run.
class RandomScene {
 public:
  RandomScene(std::uint64_t seed, const Options& options) : random_(seed), options_(options) {
    std::vector<MeshObstacle> obstacles;
    plate_ = make_mesh({"box", 12, 1, {kFloor_m, kFloor_m, 0.02}});
    X_WPlate_ = {random_.chance(0.5) ? Quaterniond::Identity() : random_.rotation(random_.uniform(0.0, 0.4)),
                 {0.0, 0.0, -0.01}};
    obstacles.emplace_back("plate", MeshBvh(plate_), X_WPlate_);
    has_hand_ = random_.chance(0.5);
    scene_ =
        std::make_unique<Scene>(tool_body(random_mesh(random_), 0.5, 0.2), std::vector<HalfSpaceSettings>{},
                                std::vector<ConvexObstacle>{}, std::move(obstacles));
    const int count = random_.integer(1, 6);
    for (int k = 0; k < count; ++k) {
      FreeBody body;
      body.name = "body " + std::to_string(k);
      body.body = tool_body(random_mesh(random_), 1.0, random_.log_uniform(1e-3, 10.0));
      body.friction = random_.uniform(0.0, 1.0);
      if (random_.chance(0.5)) body.restitution = random_.uniform(0.0, 1.0);
      body.motion.X_WB = {random_.rotation(),
                          {random_.uniform(-0.04, 0.04), random_.uniform(-0.04, 0.04), 0.16 + 0.16 * k}};
      body.motion.velocity_W_m_per_s = random_.vector<3>(0.3);
      set_angular_velocity_W(body.body.solid.inertia, random_.vector<3>(5.0), body.motion);
      bodies_.push_back(std::move(body));
    }
    BodyWorld::Settings settings;
    settings.tool_friction = random_.uniform(0.0, 0.5);
    world_ = std::make_unique<BodyWorld>(*scene_, bodies_, settings);
    BodyMotion tool;
    tool.X_WB.translation_m = {-0.12, 0.0, 0.1};
    world_->place(0, tool);
    pose_ = target_ = tool.X_WB;
    for (std::size_t i = 0; i <= bodies_.size(); ++i) {
      with_plate_.push_back(std::make_unique<ExactIntersection>(mesh(i), plate_));
      for (std::size_t j = i + 1; j <= bodies_.size(); ++j)
        pairs_.push_back({i, j, std::make_unique<ExactIntersection>(mesh(i), mesh(j))});
    }
  }

  /// Runs the scene and adds its figures to the totals. Returns the energy that the bodies gained [J].
  double run(Totals& totals) {
    double gain_J = 0.0;
    const int ticks = static_cast<int>(options_.seconds / kTick_s);
    for (int tick = 0; tick < ticks; ++tick) {
      const double before_J = world_->energy_J();
      std::vector<Pose> X_WB_before;
      for (std::size_t i = 0; i < world_->body_count(); ++i) X_WB_before.push_back(world_->motion(i).X_WB);
      if (options_.grasps && has_hand_) totals.grasps += change_grasp(tick);
      const double start_us = thread_time_us();
      const BodyWorld::Status status = world_->step(hand(), kTick_s);
      totals.tick_us.push_back(thread_time_us() - start_us);
      totals.unfinished += status != BodyWorld::Status::converged ? 1 : 0;
      ++totals.ticks;
      gain_J += std::max(0.0, world_->energy_J() - before_J - work_of_tool_J(X_WB_before));
      if (tick % options_.overlap_ticks == 0) totals.overlaps += overlaps(totals);
    }
    ++totals.scenes;
    return gain_J;
  }

 private:
  struct Pair {
    std::size_t a, b;
    std::unique_ptr<ExactIntersection> exact;
  };

  const TriangleMesh& mesh(std::size_t i) const {
    return i == 0 ? scene_->tool().mesh : bodies_[i - 1].body.mesh;
  }

  /// The hand goes straight to one random pose after the other, at up to 5 m/s.
  std::optional<BodyWorld::Hand> hand() {
    if (!has_hand_) return std::nullopt;
    const Vector3d way = target_.translation_m - pose_.translation_m;
    const double step_m = speed_m_per_s_ * kTick_s;
    if (way.norm() <= step_m) {
      target_ = {random_.rotation(),
                 {random_.uniform(-0.08, 0.08), random_.uniform(-0.08, 0.08), random_.uniform(-0.02, 0.15)}};
      speed_m_per_s_ = random_.log_uniform(0.05, 5.0);
    } else {
      pose_.translation_m += step_m / way.norm() * way;
      pose_.rotation = pose_.rotation.slerp(0.02, target_.rotation);
    }
    return BodyWorld::Hand{pose_, 3000.0};
  }

  /// At random ticks, at least 0.2 s apart, in which the tool has returned to the hand. Returns the number of
  /// new grasps.
  long change_grasp(int tick) {
    if (world_->grasp_broke()) next_change_ = tick + kReturn_ticks;
    if (tick < next_change_) return 0;
    const std::size_t held = world_->held_body();
    if (held != 0) {
      world_->let_go();
    } else if (!world_->grasp()) {
      return 0;
    }
    next_change_ = tick + kReturn_ticks + random_.integer(0, 300);
    return held == 0 ? 1 : 0;
  }

  /// Work of the tool on the bodies in the last step, with the forces at its end.
  double work_of_tool_J(const std::vector<Pose>& X_WB_before) const {
    double work_J = 0.0;
    if (world_->held_body() != 0 || world_->grasp_broke()) {
      const Pose &start = X_WB_before[0], &end = world_->motion(0).X_WB;
      const Quaterniond turn = (end.rotation * start.rotation.conjugate()).normalized();
      const Wrench& load_W = world_->tool_load_W();
      work_J -= load_W.force_N.dot(end.translation_m - start.translation_m) +
                2.0 * std::copysign(1.0, turn.w()) * load_W.torque_Nm.dot(turn.vec());
    }
    for (const BodyContact& c : world_->contacts()) {
      if (c.a != 0 || c.b == BodyContact::kFixed) continue;
      const Pose &start = X_WB_before[c.b], &end = world_->motion(c.b).X_WB;
      const Pose middle = {start.rotation.slerp(0.5, end.rotation),
                           0.5 * (start.translation_m + end.translation_m)};
      const Vector3d p_B = inverse(middle) * c.point_W_m;
      work_J -= c.force_W_N.dot(end * p_B - start * p_B);
    }
    return work_J;
  }

  long overlaps(Totals& totals) const {
    long found = 0;
    for (std::size_t i = has_hand_ ? 0 : 1; i < with_plate_.size(); ++i) {
      ++totals.poses;
      found += with_plate_[i]->intersect(inverse(X_WPlate_) * world_->motion(i).X_WB) ? 1 : 0;
    }
    for (const Pair& pair : pairs_) {
      if (pair.a == 0 && !has_hand_) continue;
      ++totals.poses;
      const Pose X_BA = inverse(world_->motion(pair.b).X_WB) * world_->motion(pair.a).X_WB;
      found += pair.exact->intersect(X_BA) ? 1 : 0;
    }
    return found;
  }

  RandomValues random_;
  Options options_;
  TriangleMesh plate_;
  Pose X_WPlate_;
  bool has_hand_ = false;
  std::unique_ptr<Scene> scene_;
  std::vector<FreeBody> bodies_;
  std::unique_ptr<BodyWorld> world_;
  Pose pose_, target_;
  double speed_m_per_s_ = 0.2;
  int next_change_ = 0;
  std::vector<std::unique_ptr<ExactIntersection>> with_plate_;
  std::vector<Pair> pairs_;
};

double quantile(std::vector<double>& sorted, double fraction) {
  return sorted[std::min(sorted.size() - 1,
                         static_cast<std::size_t>(fraction * static_cast<double>(sorted.size())))];
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("prove_bodies: random scenes of free bodies; nothing overlaps, and no energy is created.");
  Options options;
  app.add_option("--scenes", options.scenes, "number of scenes")
      ->check(CLI::Range(1L, 100000000L))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "seed of the first scene")->capture_default_str();
  app.add_option("--seconds", options.seconds, "duration of a scene [s]")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  app.add_option("--overlap-ticks", options.overlap_ticks, "ticks between two exact tests of all pairs")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_flag("--grasps", options.grasps, "the hand holds bodies that it touches, and lets go of them");
  app.add_flag("--verbose", options.verbose, "prints a line for each scene");
  CLI11_PARSE(app, argc, argv);
  Totals totals;
  for (long k = 0; k < options.scenes; ++k) {
    const std::uint64_t seed = options.seed + static_cast<std::uint64_t>(k);
    const long overlaps_before = totals.overlaps;
    RandomScene scene(seed, options);
    const double gain_J_per_s = scene.run(totals) / options.seconds;
    const bool violates = !(gain_J_per_s <= kMostGain_J_per_s) || totals.overlaps > overlaps_before;
    totals.violations += violates ? 1 : 0;
    totals.worst_gain_J_per_s = std::max(gain_J_per_s, totals.worst_gain_J_per_s);
    if (options.verbose || violates)
      std::printf("scene %llu gain_uJ_per_s %.3g overlaps %ld\n", static_cast<unsigned long long>(seed),
                  1e6 * gain_J_per_s, totals.overlaps - overlaps_before);
  }
  std::sort(totals.tick_us.begin(), totals.tick_us.end());
  std::printf(
      "prove_bodies scenes %ld grasps %ld ticks %ld unfinished %ld poses %ld overlaps %ld "
      "worst_gain_uJ_per_s %.3g "
      "p50_us %.0f "
      "p99_us %.0f p999_us %.0f max_us %.0f violations %ld\n",
      totals.scenes, totals.grasps, totals.ticks, totals.unfinished, totals.poses, totals.overlaps,
      1e6 * totals.worst_gain_J_per_s, quantile(totals.tick_us, 0.5), quantile(totals.tick_us, 0.99),
      quantile(totals.tick_us, 0.999), totals.tick_us.back(), totals.violations);
  return totals.violations == 0 ? 0 : 1;
}
