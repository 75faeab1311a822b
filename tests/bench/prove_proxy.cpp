// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/proxy.hpp"
#include "tests/bench/statistics.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"

// Twenty scenes with rough manipulation. The program checks every pose of the proxy in exact arithmetic,
// which takes minutes to hours; a test does the same for a few hundred poses. With --moving the obstacles
// also move, as fast as hands do.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

struct Tally {
  long overlaps = 0, caught = 0, free = 0, converged = 0, budget_spent = 0, jumps = 0;
  std::uint32_t most_visits = 0;
  double latest_s = 0.0;  ///< scene time at which the obstacles were last updated
  double worst_residual = 0.0;
  std::vector<double> tick_us;
};

constexpr double kTick_s = 1e-3;

/// Returns a random translation, rotation or both, which reverses periodically.
ObstacleMotion random_motion(std::uint64_t seed) {
  RandomValues random(seed);
  ObstacleMotion motion;
  const double which = random.uniform(0.0, 3.0);
  if (which < 2.0) motion.linear_m_per_s = random.log_uniform(0.01, 2.0) * random.unit<3>();
  if (which > 1.0) motion.angular_rad_per_s = random.log_uniform(0.1, 20.0) * random.unit<3>();
  motion.reverse_after_s = random.log_uniform(0.02, 0.5);
  return motion;
}

/// Returns true if the tool passed to the other side of the plate between two ticks. The plate is wider than
/// the stabs.
bool jumped(const ManipulationCase& handling, const Pose& X_OT_before, const Pose& X_OT_after) {
  const double wide_m = 0.03;
  const Vector3d &before = X_OT_before.translation_m, &after = X_OT_after.translation_m;
  return handling.motion == HandMotion::stab && handling.obstacle.kind == "plate" &&
         before.z() * after.z() < 0.0 && before.head<2>().norm() < wide_m && after.head<2>().norm() < wide_m;
}

Tally handle(const ManipulationCase& handling, long poses, std::uint64_t seed, const ObstacleMotion& motion) {
  const Scene scene = scene_of(handling, motion);
  const MeshObstacle& obstacle = scene.meshes()[0];
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), obstacle.mesh->surface.mesh());
  Proxy proxy(scene);
  HandTrajectory hand(handling, seed);
  const Pose X_OT_start = {Quaterniond::Identity(), handling.start_m};
  Pose X_WQ = obstacle.X_WO * X_OT_start, X_OQ = X_OT_start;
  Tally tally;
  for (long n = 1; n <= poses; ++n) {
    const double time_s = static_cast<double>(n) * kTick_s;
    const Pose X_WP = hand.next();
    const auto begin = std::chrono::steady_clock::now();
    const Projection q = proxy.follow(X_WP, X_WQ, time_s);
    tally.tick_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count());
    tally.most_visits = std::max(tally.most_visits, proxy.node_visits());
    if (q.status == ProjectionStatus::infeasible) {  // the servo loop reinitializes the proxy in this case
      ++tally.caught;
      X_OQ = X_OT_start;
      X_WQ = obstacle.X_WO_at(time_s) * X_OQ;
      proxy.clear_history(time_s);
      continue;
    }
    X_WQ = q.X_WQ;
    const Pose X_OQ_last = X_OQ;
    X_OQ = inverse(obstacle.X_WO_at(proxy.admissible_time_s())) * X_WQ;
    tally.jumps += jumped(handling, X_OQ_last, X_OQ) ? 1 : 0;
    tally.overlaps += exact.intersect(X_OQ) ? 1 : 0;
    tally.free += q.status == ProjectionStatus::free ? 1 : 0;
    tally.budget_spent += q.status == ProjectionStatus::budget_spent ? 1 : 0;
    if (motion.moves()) tally.latest_s = std::max(tally.latest_s, time_s - proxy.admissible_time_s());
    if (q.status == ProjectionStatus::converged) {
      ++tally.converged;
      tally.worst_residual = std::max(tally.worst_residual, q.kkt_residual);
    }
  }
  return tally;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("prove_proxy: checks in exact arithmetic that the proxy overlaps no obstacle.");
  long poses = 1000;
  std::uint64_t seed = 1;
  std::string only;
  app.add_option("--poses", poses, "number of poses per scene")
      ->check(CLI::Range(1L, 100000000L))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the hand's motion")->capture_default_str();
  app.add_option("--only", only, "runs only scenes whose name contains this text");
  bool moving = false;
  app.add_flag("--moving", moving, "the obstacles move too, at random");
  CLI11_PARSE(app, argc, argv);

  std::printf("%-42s %9s %8s %5s %9s %9s %7s %7s %6s %8s %8s %8s %8s\n", "scene", "poses", "overlaps",
              "jumps", "free", "converged", "spent", "caught", "visits", "late ms", "residual", "p50 us",
              "max us");
  std::mutex printing;
  std::atomic<std::size_t> next = 0;
  std::atomic<long> faults = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < manipulation_cases().size(); i = next++) {
      const ManipulationCase& handling = manipulation_cases()[i];
      if (handling.name.find(only) == std::string::npos) continue;
      const Tally t =
          handle(handling, poses, seed, moving ? random_motion(100 * seed + i) : ObstacleMotion{});
      const auto times = bench::quantiles(t.tick_us);
      const std::lock_guard lock(printing);
      std::printf("%-42s %9ld %8ld %5ld %9ld %9ld %7ld %7ld %6u %8.1f %8.1e %8.1f %8.0f\n",
                  handling.name.c_str(), poses, t.overlaps, t.jumps, t.free, t.converged, t.budget_spent,
                  t.caught, t.most_visits, 1e3 * t.latest_s, t.worst_residual, times.p50, times.max);
      std::fflush(stdout);
      faults += t.overlaps + t.jumps + (moving ? 0 : t.caught);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < std::max(1U, std::thread::hardware_concurrency()); ++k) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::printf("%ld overlaps, jumps and poses without an answer, seed %llu\n", faults.load(),
              static_cast<unsigned long long>(seed));
  return faults == 0 ? 0 : 1;
}
