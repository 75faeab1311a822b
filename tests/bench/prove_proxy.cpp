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
#include "tests/support/exact_meeting.hpp"
#include "tests/support/handling.hpp"

// Twenty scenes handled roughly, every pose of the proxy looked at in exact arithmetic. Minutes to hours; a
// test does the same for a few hundred poses.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

struct Tally {
  long overlaps = 0, infeasible = 0, free = 0, converged = 0, budget_spent = 0, jumps = 0;
  int most_looks = 0;
  double worst_residual = 0.0;
  std::vector<double> tick_us;
};

/// Did the tool come to the other side of the plate between two ticks? The plate is wider than the stabs.
bool jumped(const Handling& handling, const Pose& before, const Pose& after) {
  const double wide_m = 0.03;
  return handling.motion == Motion::stab && handling.obstacle.kind == "plate" &&
         before.translation_m.z() * after.translation_m.z() < 0.0 &&
         before.translation_m.head<2>().norm() < wide_m && after.translation_m.head<2>().norm() < wide_m;
}

Tally handle(const Handling& handling, long poses, std::uint64_t seed) {
  const Scene scene = scene_of(handling);
  const ExactMeeting exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  Proxy proxy(scene);
  Hand hand(handling, seed);
  Pose X_WQ = {Quaterniond::Identity(), handling.start_m};
  Tally tally;
  for (long n = 0; n < poses; ++n) {
    const Pose X_WP = hand.next();
    const auto begin = std::chrono::steady_clock::now();
    const Projection q = proxy.follow(X_WP, X_WQ);
    tally.tick_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count());
    tally.jumps += jumped(handling, X_WQ, q.X_WQ) ? 1 : 0;
    tally.overlaps += exact.meet(q.X_WQ) ? 1 : 0;
    tally.free += q.status == ProjectionStatus::free ? 1 : 0;
    tally.infeasible += q.status == ProjectionStatus::infeasible ? 1 : 0;
    tally.budget_spent += q.status == ProjectionStatus::budget_spent ? 1 : 0;
    if (q.status == ProjectionStatus::converged) {
      ++tally.converged;
      tally.worst_residual = std::max(tally.worst_residual, q.kkt_residual);
    }
    tally.most_looks = std::max<int>(tally.most_looks, proxy.looks());
    X_WQ = q.X_WQ;
  }
  return tally;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "prove_proxy: does the proxy ever overlap anything? Every pose is looked at in exact arithmetic.");
  long poses = 1000;
  std::uint64_t seed = 1;
  std::string only;
  app.add_option("--poses", poses, "in each scene")->check(CLI::Range(1L, 100000000L))->capture_default_str();
  app.add_option("--seed", seed, "of the hand")->capture_default_str();
  app.add_option("--only", only, "scenes with this in their name");
  CLI11_PARSE(app, argc, argv);

  std::printf("%-42s %9s %8s %5s %9s %9s %7s %5s %8s %8s %8s\n", "scene", "poses", "overlaps", "jumps",
              "free", "converged", "spent", "looks", "residual", "p50 us", "max us");
  std::mutex printing;
  std::atomic<std::size_t> next = 0;
  std::atomic<long> faults = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < rough_handling().size(); i = next++) {
      const Handling& handling = rough_handling()[i];
      if (handling.name.find(only) == std::string::npos) continue;
      const Tally t = handle(handling, poses, seed);
      const auto times = bench::quantiles(t.tick_us);
      const std::lock_guard lock(printing);
      std::printf("%-42s %9ld %8ld %5ld %9ld %9ld %7ld %5d %8.1e %8.1f %8.0f\n", handling.name.c_str(), poses,
                  t.overlaps, t.jumps, t.free, t.converged, t.budget_spent, t.most_looks, t.worst_residual,
                  times.p50, times.max);
      std::fflush(stdout);
      faults += t.overlaps + t.jumps + t.infeasible;
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < std::max(1U, std::thread::hardware_concurrency()); ++k) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::printf("%ld overlaps, jumps and poses without an answer, seed %llu\n", faults.load(),
              static_cast<unsigned long long>(seed));
  return faults == 0 ? 0 : 1;
}
