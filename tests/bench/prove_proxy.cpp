// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/proxy.hpp"
#include "core/metric.hpp"
#include "tests/bench/statistics.hpp"
#include "tests/support/conforming_scene.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/independent_descent.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/unbalanced_pull.hpp"

// Twenty scenes with rough manipulation, tools caged in closed shells, and scenes of fine meshes that touch
// face to face. The program checks every pose of the proxy in exact arithmetic, which takes minutes to hours;
// a test does the same for a few hundred poses. It also computes the residual of every pose that is called
// converged from its contacts. With --descents a random search, which knows nothing of contacts, looks for
// closer poses. With --moving the obstacles also move, as fast as hands do. With --surface the
// obstacles of the twenty scenes are surfaces; the shells always are.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

struct Counts {
  long overlaps = 0, caught = 0, free = 0, converged = 0, budget_spent = 0, jumps = 0;
  long untrue = 0;    ///< ticks called converged whose contacts do not balance the pull to kOptimalResidual
  long descents = 0;  ///< converged poses at which a random search looked for closer ones
  long improved = 0;  ///< poses whose energy it lowered by more than kMaxImprovement
  double most_lowered = 0.0;  ///< largest fraction by which it lowered an energy
  std::uint32_t most_visits = 0;
  double latest_s = 0.0;  ///< scene time at which the obstacles were last updated
  double worst_residual = 0.0;
  std::vector<double> tick_us;
};

constexpr double kTick_s = 1e-3;
/// Fraction of its energy by which no converged pose may be improved.
constexpr double kMaxImprovement = 1e-3;
/// Steps of one random search.
constexpr int kDescentSteps = 400;

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
  return handling.motion == Handling::stab && handling.obstacle.kind == "plate" &&
         before.z() * after.z() < 0.0 && before.head<2>().norm() < wide_m && after.head<2>().norm() < wide_m;
}

/// A scene to manipulate. C: frame of the tool that the hand moves. S: frame of the obstacle at scene time 0
/// in which the hand moves. E: frame of the tool's triangles in the exact test.
struct Bodies {
  Scene scene;
  TriangleMesh tool_E, obstacle_O;
  Pose X_TC, X_TE;
};

Bodies bodies_of(const ManipulationCase& handling, const ObstacleMotion& motion) {
  Scene scene = scene_of(handling, motion);
  TriangleMesh tool = scene.tool_mesh()->surface.mesh(), obstacle = scene.meshes()[0].mesh->surface.mesh();
  return {std::move(scene), std::move(tool), std::move(obstacle), {}, {}};
}

/// A tool inside a closed shell, which each ray from the origin meets once. Every third stab goes through the
/// shell at up to 23 m/s.
struct Cage {
  std::string name;
  GeneratedMesh tool, shell;
  double scale;  ///< factor on the size of the shell
};

const std::vector<Cage>& cages() {
  static const std::vector<Cage> all = {
      {"cube caged in a sphere", {"cube", 12}, {"sphere", 1000}, 2.5},
      {"bumpy body caged in a boulder", {"bumpy", 1000}, {"boulder", 2000}, 1.8},
      {"gear caged in a fine cube", {"gear", 1000}, {"cube", 1200}, 3.0},
      {"plate caged in a boulder", {"plate", 100}, {"boulder", 1000}, 3.0},
  };
  return all;
}

TriangleMesh shell_of(const Cage& cage) {
  TriangleMesh shell = make_mesh(cage.shell);
  for (Vector3d& p : shell.vertices_m) p *= cage.scale;
  return shell;
}

/// divides_space: MeshBvh::divides_space.
Bodies bodies_of(const Cage& cage, bool divides_space, const ObstacleMotion& motion) {
  MeshBvh shell(shell_of(cage), BodyKind::surface);
  shell.divides_space = divides_space;
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"shell", std::move(shell), Pose{}, motion});
  Scene scene(mesh_tool(make_mesh(cage.tool)), {}, {}, std::move(obstacles));
  TriangleMesh tool = scene.tool_mesh()->surface.mesh();
  return {std::move(scene), std::move(tool), shell_of(cage), {}, {}};
}

/// The hand of a caged tool: starts at the centre and stabs in random directions.
class CagedHand {
 public:
  explicit CagedHand(std::uint64_t seed) : random_(seed) {}

  const Pose& next() {
    if (ticks_++ % 20 == 0) {
      const bool fast = ticks_ % 60 == 1;
      V_.linear_m_per_s =
          (fast ? random_.uniform(5.0, 23.0) : random_.log_uniform(0.05, 5.0)) * random_.unit<3>();
      V_.angular_rad_per_s = random_.uniform(0.0, 50.0) * random_.unit<3>();
      X_WP_.translation_m = 0.03 * random_.uniform(0.0, 1.0) * random_.unit<3>();
    }
    X_WP_.translation_m += kTick_s * V_.linear_m_per_s;
    X_WP_.rotation = (X_WP_.rotation * rotation_from(kTick_s * V_.angular_rad_per_s)).normalized();
    return X_WP_;
  }

 private:
  RandomValues random_;
  Pose X_WP_;
  Twist V_;
  int ticks_ = 0;
};

/// Returns true if the shell does not enclose the tool's centre.
bool escaped(const TriangleMesh& shell, const Pose& X_OT) {
  for (const auto& [a, b, c] : shell.triangles) {
    Matrix3d corners;
    corners << shell.vertices_m[a], shell.vertices_m[b], shell.vertices_m[c];
    const Vector3d share = corners.inverse() * X_OT.translation_m;  // the centre as a sum of the corners
    if (share.minCoeff() >= -1e-12) return share.sum() >= 1.0;
  }
  return true;
}

/// Fine meshes that touch face to face. The exact test uses the triangles of their files.
struct ConformingManipulation {
  ManipulationCase handling;  ///< motion of the hand; its meshes are not used
  std::string of;             ///< name of the conforming case
};

const std::vector<ConformingManipulation>& conforming_manipulations() {
  using enum Handling;
  static const std::vector<ConformingManipulation> all = {
      {{"flat cube on a flat slab", {}, {}, slide, {0, 0, 0.026}}, "cube 10k / 10k, exact"},
      {{"flat cube on a flat slab, float", {}, {}, slide, {0, 0, 0.026}}, "cube 10k / 10k, float, rotated"},
      {{"fine cube on a coarse slab, float", {}, {}, slide, {0, 0, 0.026}}, "cube 50k / 12, float, rotated"},
      {{"shaft pressed into its bore, 10 um", {}, {}, press, {0, 0, 0}},
       "faceted shaft in bore 10 um 10k / 10k, float, rotated"},
      {{"smooth shaft shaken in its bore, 50 um", {}, {}, shake, {0, 0, 0}},
       "smooth shaft in bore 50 um 10k / 10k, exact"},
      {{"flat gears", {}, {}, shake, {0.05, 0, 0}}, "faceted gears 10k / 10k, float, rotated"},
  };
  return all;
}

Bodies bodies_of(const ConformingManipulation& conforming, const ObstacleMotion& motion) {
  const ConformingCase& of = conforming_case(conforming.of);
  MeshLoader loader;
  ConformingScene loaded =
      load_scene(of, fine_meshes(of), loader, SceneSettings{}.surface_tolerance_m, motion);
  const Pose X_TF = inverse(loaded.X_FT());
  return {std::move(loaded.scene), std::move(loaded.tool_F), std::move(loaded.obstacle_F), loaded.X_TC, X_TF};
}

/// Returns true if the tool passed through the slab or through the wall of the bore between two ticks.
bool jumped(const ConformingCase& of, const Pose& X_SC_before, const Pose& X_SC_after) {
  const Vector3d &before = X_SC_before.translation_m, &after = X_SC_after.translation_m;
  const auto aside_m = [](const Vector3d& p) { return p.head<2>().norm(); };
  switch (of.shape) {
    case ConformingShape::cube_on_slab: {
      constexpr double kMiddle_m = -0.01, kWide_m = 0.1;
      return (before.z() > kMiddle_m) != (after.z() > kMiddle_m) && aside_m(before) < kWide_m &&
             aside_m(after) < kWide_m;
    }
    case ConformingShape::shaft_in_bore: {
      constexpr double kInside_m = 0.02, kWall_m = 0.01;  // the shaft cannot leave the bore this far inside
      return std::abs(before.z()) < kInside_m && std::abs(after.z()) < kInside_m &&
             (aside_m(before) < kWall_m) != (aside_m(after) < kWall_m);
    }
    default:
      return false;
  }
}

template <class Hand, class Jumped>
Counts handle(const Vector3d& start_m, Hand hand, const Bodies& bodies, long poses, long descents,
              const ObstacleMotion& motion, const Jumped& jumped) {
  const Scene& scene = bodies.scene;
  const MeshObstacle& obstacle = scene.meshes()[0];
  const ExactIntersection exact(bodies.tool_E, bodies.obstacle_O);
  const Pose X_CT = inverse(bodies.X_TC), X_SO = obstacle.X_WO, X_OS = inverse(X_SO);
  Proxy proxy(scene);
  const Pose X_OT_start = X_OS * Pose{Quaterniond::Identity(), start_m} * X_CT;
  Pose X_WQ = obstacle.X_WO * X_OT_start, X_OQ = X_OT_start;
  Counts counts;
  for (long n = 1; n <= poses; ++n) {
    const double time_s = static_cast<double>(n) * kTick_s;
    const Pose X_WP = hand.next() * X_CT;
    const auto begin = std::chrono::steady_clock::now();
    const Projection q = proxy.follow(X_WP, X_WQ, time_s);
    counts.tick_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count());
    counts.most_visits = std::max(counts.most_visits, proxy.node_visits());
    if (q.status == ProjectionStatus::infeasible) {  // the servo loop reinitializes the proxy in this case
      ++counts.caught;
      X_OQ = X_OT_start;
      X_WQ = obstacle.X_WO_at(time_s) * X_OQ;
      proxy.clear_history(time_s);
      continue;
    }
    X_WQ = q.X_WQ;
    const Pose X_OQ_last = X_OQ;
    X_OQ = inverse(obstacle.X_WO_at(proxy.admissible_time_s())) * X_WQ;
    counts.jumps += jumped(X_SO * X_OQ_last * bodies.X_TC, X_SO * X_OQ * bodies.X_TC) ? 1 : 0;
    counts.overlaps += exact.intersect(X_OQ * bodies.X_TE) ? 1 : 0;
    counts.free += q.status == ProjectionStatus::free ? 1 : 0;
    counts.budget_spent += q.status == ProjectionStatus::budget_spent ? 1 : 0;
    if (motion.moves()) counts.latest_s = std::max(counts.latest_s, time_s - proxy.admissible_time_s());
    if (q.status == ProjectionStatus::converged) {
      ++counts.converged;
      counts.worst_residual = std::max(counts.worst_residual, q.kkt_residual);
      // The contacts of moving obstacles are stated for other poses than the scene's.
      const bool true_optimum = motion.moves() ? q.kkt_residual <= kOptimalResidual
                                               : unbalanced_pull(scene, X_WP, q) <= kOptimalResidual;
      counts.untrue += true_optimum ? 0 : 1;
      const long due = descents > 0 ? counts.descents * poses / descents : poses;
      if (n > due && q.energy > 0.0 && !motion.moves()) {
        const Inertia& M = scene.tool().solid.inertia;
        const double least = descend_at_random(exact, M, X_WP, X_WQ, obstacle.X_WO, bodies.X_TE,
                                               static_cast<std::uint64_t>(n), kDescentSteps);
        const double lowered = 1.0 - least / energy(M, X_WP, X_WQ);
        ++counts.descents;
        counts.improved += lowered > kMaxImprovement ? 1 : 0;
        counts.most_lowered = std::max(counts.most_lowered, lowered);
      }
    }
  }
  return counts;
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
  long descents = 0;
  app.add_option("--descents", descents, "number of random searches for closer poses per scene")
      ->check(CLI::Range(0L, 100000000L))
      ->capture_default_str();
  bool moving = false;
  app.add_flag("--moving", moving, "the obstacles move too, at random");
  bool surfaces = false;
  app.add_flag("--surface", surfaces, "the obstacles of the twenty scenes are surfaces");
  bool two_sided = false;
  app.add_flag("--two-sided", two_sided,
               "the tool can meet surfaces from both sides, as if they were not known to divide space");
  CLI11_PARSE(app, argc, argv);

  std::printf("%-42s %9s %8s %5s %9s %9s %6s %7s %7s %6s %8s %8s %8s %8s\n", "scene", "poses", "overlaps",
              "jumps", "free", "converged", "untrue", "spent", "caught", "visits", "late ms", "residual",
              "p50 us", "max us");
  std::mutex printing;
  std::atomic<std::size_t> next = 0;
  std::atomic<long> faults = 0;
  struct Task {
    std::string name;
    std::function<Counts(const ObstacleMotion&)> run;
  };
  std::vector<Task> tasks;
  for (ManipulationCase handling : manipulation_cases()) {
    handling.obstacle_kind = surfaces ? BodyKind::surface : BodyKind::solid;
    handling.divides_space = surfaces && !two_sided;
    tasks.push_back({handling.name, [=](const ObstacleMotion& motion) {
                       return handle(handling.start_m, HandTrajectory(handling, seed),
                                     bodies_of(handling, motion), poses, descents, motion,
                                     [&](const Pose& before, const Pose& after) {
                                       return jumped(handling, before, after);
                                     });
                     }});
  }
  for (const ConformingManipulation& conforming : conforming_manipulations())
    tasks.push_back({conforming.handling.name, [&, conforming](const ObstacleMotion& motion) {
                       return handle(conforming.handling.start_m, HandTrajectory(conforming.handling, seed),
                                     bodies_of(conforming, motion), poses, descents, motion,
                                     [&](const Pose& before, const Pose& after) {
                                       return jumped(conforming_case(conforming.of), before, after);
                                     });
                     }});
  for (const Cage& cage : cages())
    tasks.push_back({cage.name, [&](const ObstacleMotion& motion) {
                       const TriangleMesh shell = shell_of(cage);
                       return handle(Vector3d::Zero(), CagedHand(seed), bodies_of(cage, !two_sided, motion),
                                     poses, descents, motion,
                                     [&](const Pose&, const Pose& after) { return escaped(shell, after); });
                     }});
  const auto work = [&] {
    for (std::size_t i = next++; i < tasks.size(); i = next++) {
      const Task& task = tasks[i];
      if (task.name.find(only) == std::string::npos) continue;
      const ObstacleMotion motion = moving ? random_motion(100 * seed + i) : ObstacleMotion{};
      const Counts t = task.run(motion);
      const auto times = bench::quantiles(t.tick_us);
      const std::lock_guard lock(printing);
      std::printf("%-42s %9ld %8ld %5ld %9ld %9ld %6ld %7ld %7ld %6u %8.1f %8.1e %8.1f %8.0f\n",
                  task.name.c_str(), poses, t.overlaps, t.jumps, t.free, t.converged, t.untrue,
                  t.budget_spent, t.caught, t.most_visits, 1e3 * t.latest_s, t.worst_residual, times.p50,
                  times.max);
      std::fflush(stdout);
      if (descents > 0)
        std::printf(
            "%-42s %9ld random searches, %ld lowered the energy by more than 0.1 %%, at most %.2g %%\n", "",
            t.descents, t.improved, 100.0 * t.most_lowered);
      faults += t.overlaps + t.jumps + t.untrue + (moving ? 0 : t.caught);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < std::max(1U, std::thread::hardware_concurrency()); ++k) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::printf("%ld overlaps, jumps, poses without an answer and untrue optima, seed %llu\n", faults.load(),
              static_cast<unsigned long long>(seed));
  return faults == 0 ? 0 : 1;
}
