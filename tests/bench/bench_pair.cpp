// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/meshes/mesh_file.hpp"
#include "collision/penetration.hpp"
#include "tests/bench/statistics.hpp"
#include "tests/bench/trajectory_run.hpp"
#include "tests/support/contact_seeking_hand.hpp"
#include "tests/support/exact_intersection.hpp"

// Two mesh files: a hand presses the tool onto the obstacle, slides and rotates it. The program prints the
// time of the ticks, and checks in exact arithmetic that the triangles of the files do not intersect.

namespace {

using namespace wrenchd;
using namespace wrenchd::bench;
using namespace wrenchd::test;

constexpr double kToolMass_kg = 0.2;  ///< that of the shipped scene

struct Options {
  std::vector<std::filesystem::path> files;
  double scale = 0.001;
  std::size_t ticks = 10000;
  int passes = 2;
  std::vector<std::uint64_t> seeds = {1};
  std::size_t exact_poses = 100;
  double tolerance_um = 2.0, surface_tolerance_um = 1.0;
  bool surface = false, reference = false;
  std::filesystem::path cache;
  ContactSeekingHand::Limits hand;
};

/// Returns the triangles of a file as they are, in metres.
TriangleMesh triangles_of(const std::filesystem::path& file, double scale) {
  const PolygonSoup soup = parse_mesh(read_mesh_source(file));
  TriangleMesh mesh;
  for (const Vector3d& p : soup.vertices) mesh.vertices_m.push_back(scale * p);
  const auto index = [](std::size_t v) { return static_cast<std::uint32_t>(v); };
  for (const auto& face : soup.faces)
    for (std::size_t i = 1; i + 1 < face.size(); ++i)
      mesh.triangles.push_back({index(face[0]), index(face[i]), index(face[i + 1])});
  return mesh;
}

/// Lets the hand act on the proxy and returns its poses.
std::vector<Pose> commanded_poses(const Scene& scene, ContactSeekingHand hand, std::size_t ticks) {
  std::vector<Pose> X_WP = {hand.start()};
  Proxy proxy(scene);
  Pose X_WQ = hand.start();
  while (X_WP.size() < ticks) {
    X_WP.push_back(hand.next(X_WQ));
    const Projection q = proxy.follow(X_WP.back(), X_WQ);
    if (q.status != ProjectionStatus::infeasible) X_WQ = q.X_WQ;
  }
  return X_WP;
}

void print_run(std::uint64_t seed, const std::vector<ProxyTick>& run, const std::vector<Pose>& X_WP) {
  std::vector<double> us, in_contact_us;
  std::uint32_t visits = 0;
  double force_N = 0.0;
  std::size_t late = 0;
  for (const ProxyTick& tick : run) {
    us.push_back(tick.us);
    if (tick.status != ProjectionStatus::free) in_contact_us.push_back(tick.us);
    late += tick.us > 1000.0 ? 1 : 0;
    visits = std::max(visits, tick.node_visits);
    force_N = std::max(force_N, tick.force_W_N.norm());
  }
  const Quantiles all = quantiles(us), touching = quantiles(in_contact_us);
  std::printf("%6llu %8zu %10.1f %8.1f %8.0f %8.0f %8.0f %8.0f %8.0f %7.2f %8.2f %8u",
              static_cast<unsigned long long>(seed), X_WP.size(),
              100.0 * static_cast<double>(in_contact_us.size()) / static_cast<double>(run.size()),
              100.0 * share_of(run, ProjectionStatus::budget_spent), all.p50, touching.p50, all.p99,
              touching.p99, all.max, 100.0 * static_cast<double>(late) / static_cast<double>(run.size()),
              force_N, visits);
}

/// Returns the number of poses at which the triangles of the files intersect, of those in contact.
std::pair<std::size_t, std::size_t> overlaps(const std::vector<ProxyTick>& run, const Pose& X_TM,
                                             const ExactIntersection& exact, std::size_t poses) {
  std::vector<const ProxyTick*> touching;
  for (const ProxyTick& tick : run)
    if (tick.status != ProjectionStatus::free) touching.push_back(&tick);
  const std::size_t checked = std::min(poses, touching.size());
  std::size_t found = 0;
  for (std::size_t k = 0; k < checked; ++k)
    found += exact.intersect(touching[k * touching.size() / checked]->X_WQ * X_TM) ? 1 : 0;
  return {found, checked};
}

int measure(const Options& options) {
  SceneSettings settings;
  settings.surface_tolerance_m = 1e-6 * options.surface_tolerance_um;
  settings.tool = {options.files[0], options.scale, kToolMass_kg};
  settings.meshes.push_back({"obstacle", options.files[1], options.scale, Pose{},
                             options.surface ? BodyKind::surface : BodyKind::solid});
  MeshLoader loader(options.cache, {});
  const auto begin = std::chrono::steady_clock::now();
  const Scene scene(settings, loader);
  const double load_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  for (const std::string& change : loader.changes()) std::cerr << "note: " << change << '\n';
  for (const std::string& text : loader.simplifications())
    std::cout << text.substr(text.rfind('/') + 1) << '\n';

  const TriangleMesh tool = triangles_of(options.files[0], options.scale);
  const TriangleMesh obstacle = triangles_of(options.files[1], options.scale);
  std::printf("%s: %zu triangles on %s: %zu triangles; loaded in %.2f s\n",
              options.files[0].filename().c_str(), tool.triangles.size(), options.files[1].filename().c_str(),
              obstacle.triangles.size(), load_s);
  std::printf(
      "  seed    ticks in contact  spent %%   p50 us  contact   p99 us  contact   max us  >1ms %%  F max N   "
      "visits overlaps%s\n",
      options.reference ? "  behind %  lag ms  diff um" : "");
  const Pose X_TM = inverse(scene.tool().X_MT());
  TriangleMesh tool_T = tool;
  for (Vector3d& p : tool_T.vertices_m) p = X_TM * p;
  const ExactIntersection exact(tool, obstacle);
  std::size_t overlapping = 0;
  for (const std::uint64_t seed : options.seeds) {
    const std::vector<Pose> X_WP =
        commanded_poses(scene, {tool_T, obstacle, seed, options.hand}, options.ticks);
    const std::vector<ProxyTick> run = follow_trajectory(scene, {}, X_WP, options.passes);
    print_run(seed, run, X_WP);
    const auto [found, checked] = overlaps(run, X_TM, exact, options.exact_poses);
    overlapping += found;
    std::printf(" %zu of %zu", found, checked);
    if (options.reference) {
      const LagReport lag = compare(run, Pose{}, follow_trajectory(scene, unlimited_work(), X_WP), Pose{},
                                    box_corners(tool_T), 1e-6 * options.tolerance_um);
      std::printf(" %8.1f %7zu %8.1f", 100.0 * lag.behind_share, lag.longest_ticks, 1e6 * lag.largest_m);
    }
    std::printf("\n");
    std::fflush(stdout);
  }
  return overlapping == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "Presses, slides and rotates one mesh on another: time of the ticks, and overlaps in exact "
      "arithmetic."};
  app.add_option("files", options.files, "mesh of the tool and mesh of the obstacle")
      ->required()
      ->expected(2);
  app.add_option("--scale", options.scale, "metres per mesh unit")->capture_default_str();
  app.add_flag("--surface", options.surface, "the obstacle is a surface, which may be open");
  app.add_option("--ticks", options.ticks, "number of ticks per seed, 1 ms apart")
      ->check(CLI::Range(10, 10000000))
      ->capture_default_str();
  app.add_option("--passes", options.passes, "the time of a tick is the minimum of this number of passes")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--seed", options.seeds, "seeds of the hand's motion, one row each")->capture_default_str();
  app.add_flag_callback(
      "--axis", [&] { options.hand.approach = ContactSeekingHand::Approach::axis; },
      "presses down along z onto the middle of the obstacle, as a knob on its nut");
  app.add_option("--speed", options.hand.speed_m_per_s, "speed of the hand [m/s]")->capture_default_str();
  app.add_option("--exact", options.exact_poses, "number of poses in contact to check in exact arithmetic")
      ->capture_default_str();
  app.add_flag("--reference", options.reference,
               "compares each tick with the proxy that has unlimited work; slow");
  app.add_option("--tolerance-um", options.tolerance_um, "difference from which a tick is behind [um]")
      ->capture_default_str();
  app.add_option("--surface-tolerance-um", options.surface_tolerance_um,
                 "surface tolerance of the scene [um]; 0: the meshes as they are")
      ->capture_default_str();
  app.add_option("--cache", options.cache, "directory of the mesh cache");
  CLI11_PARSE(app, argc, argv);
  try {
    return measure(options);
  } catch (const std::exception& error) {
    std::cerr << "bench_pair: " << error.what() << '\n';
    return 2;
  }
}
