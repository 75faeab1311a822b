// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "tests/bench/statistics.hpp"
#include "tests/bench/stopwatch.hpp"
#include "tests/bench/trajectory_run.hpp"
#include "tests/support/conforming_case.hpp"
#include "tests/support/conforming_mesh.hpp"
#include "tests/support/temporary_directory.hpp"

// Conforming contact of fine meshes: the proxy of each fine mesh is compared on every tick with the proxy of a
// coarse mesh of the same shape, which has unlimited work.

namespace {

using namespace wrenchd;
using namespace wrenchd::bench;
using namespace wrenchd::test;

struct Options {
  std::vector<std::string> cases;
  std::size_t ticks = 2200;
  int passes = 2;
  std::uint64_t seed = 1;
  double tolerance_um = 2.0;
  double surface_tolerance_um = 1.0;
  std::filesystem::path cache;
  bool list = false;
  bool fine_reference = false;
};

/// A scene and the pose of the shape's frame C in the tool's body frame T.
struct LoadedCase {
  Scene scene;
  Pose X_TC;
  double load_s = 0.0;
};

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Writes the meshes and loads them as wrenchd does: from an STL file in float, else from an OFF file.
LoadedCase load(const ConformingCase& of, const MeshesOfCase& meshes, double surface_tolerance_m,
                MeshLoader& loader) {
  const TemporaryDirectory directory;
  const Quaterniond R_FC = file_rotation(of);
  const Pose X_WF = {R_FC.conjugate(), Vector3d::Zero()};
  const auto write = [&](const std::string& name, const TriangleMesh& mesh) {
    const std::filesystem::path file = directory.path() / (name + (of.in_float ? ".stl" : ".off"));
    std::ofstream out(file, std::ios::binary);
    const TriangleMesh in_file = of.rotated ? rotated(mesh, R_FC) : mesh;
    of.in_float ? write_binary_stl(out, in_file) : write_off(out, in_file);
    return file;
  };
  const double scale = of.in_float ? 0.001 : 1.0;
  SceneSettings settings;
  settings.tool.mesh = write("tool", meshes.tool);
  settings.tool.scale = scale;
  settings.tool.mass_kg = kToolMass_kg;
  settings.meshes.push_back({"obstacle", write("obstacle", meshes.obstacle), scale, X_WF});
  const auto begin = std::chrono::steady_clock::now();
  settings.surface_tolerance_m = surface_tolerance_m;
  LoadedCase loaded = {Scene(settings, loader), {}, 0.0};
  loaded.load_s = seconds_since(begin);
  loaded.X_TC = inverse(loaded.scene.tool().X_MT()) * Pose{R_FC, Vector3d::Zero()};
  return loaded;
}

std::vector<Pose> body_poses(const std::vector<Pose>& X_WC, const Pose& X_TC) {
  std::vector<Pose> X_WP;
  const Pose X_CT = inverse(X_TC);
  for (const Pose& X : X_WC) X_WP.push_back(X * X_CT);
  return X_WP;
}

constexpr const char* kHeader =
    "case                                            load s  spent % behind % lag ms   lag mm  diff um "
    "  p50 us   p99 us   max us  >1ms %  F max N  dFmax %     dF %   visits max";

void print_row(const std::string& name, double load_s, const std::vector<ProxyTick>& run,
               const LagReport& lag) {
  std::vector<double> us;
  std::uint32_t visits = 0;
  std::size_t late = 0;
  for (const ProxyTick& tick : run) {
    us.push_back(tick.us);
    visits = std::max(visits, tick.node_visits);
    late += tick.us > 1000.0 ? 1 : 0;
  }
  const Quantiles times = quantiles(us);
  const double per_force = lag.reference_force_N > 0.0 ? 100.0 / lag.reference_force_N : 0.0;
  std::printf("%-46s %7.2f %8.1f %8.1f %6zu %8.2f %8.1f %8.0f %8.0f %8.0f %7.1f %8.3f %8.2f %8.2f %12u\n",
              name.c_str(), load_s, 100.0 * share_of(run, ProjectionStatus::budget_spent),
              100.0 * lag.behind_share, lag.longest_ticks, 1e3 * lag.longest_run_m, 1e6 * lag.largest_m,
              times.p50, times.p99, times.max,
              100.0 * static_cast<double>(late) / static_cast<double>(run.size()), lag.force_N,
              per_force * (lag.force_N - lag.reference_force_N), per_force * lag.force_difference_N, visits);
  const double infeasible = share_of(run, ProjectionStatus::infeasible);
  if (infeasible > 0.0) std::printf("  infeasible: %.1f %% of the ticks\n", 100.0 * infeasible);
  std::fflush(stdout);
}

void run_case(const ConformingCase& of, const Options& options) {
  MeshLoader loader(options.cache, {});
  const LoadedCase fine = load(of, fine_meshes(of), 1e-6 * options.surface_tolerance_um, loader);
  ConformingCase plain = of;
  plain.in_float = plain.rotated = false;
  MeshLoader coarse_loader;
  const MeshesOfCase coarse_of = coarse_meshes(of);
  const LoadedCase coarse = load(plain, coarse_of, 0.0, coarse_loader);
  const std::vector<Pose> X_WC = conforming_trajectory(of, options.ticks, options.seed);
  const auto run = follow_trajectory(fine.scene, {}, body_poses(X_WC, fine.X_TC), options.passes);
  const auto reference = options.fine_reference
                             ? follow_trajectory(fine.scene, unlimited_work(), body_poses(X_WC, fine.X_TC))
                             : follow_trajectory(coarse.scene, unlimited_work(), body_poses(X_WC, coarse.X_TC));
  const LagReport lag = compare(run, fine.X_TC, reference, options.fine_reference ? fine.X_TC : coarse.X_TC,
                                box_corners(coarse_of.tool), 1e-6 * options.tolerance_um);
  print_row(of.name, fine.load_s, run, lag);
  for (const std::string& text : loader.simplifications())
    std::printf("  %s\n", text.substr(text.rfind('/') + 1).c_str());
  const double unfinished = share_of(reference, ProjectionStatus::budget_spent);
  if (unfinished > 0.0)
    std::printf("  the reference did not converge at %.1f %% of the ticks\n", 100.0 * unfinished);
}

bool selected(const ConformingCase& of, const std::vector<std::string>& filters) {
  return filters.empty() || std::any_of(filters.begin(), filters.end(), [&](const std::string& text) {
           return of.name.find(text) != std::string::npos;
         });
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Conforming contact of fine meshes: time, lag and force of the proxy on each tick."};
  app.add_option("--cases", options.cases, "runs only cases whose name contains one of these texts");
  app.add_flag("--list", options.list, "lists the cases");
  app.add_option("--surface-tolerance-um", options.surface_tolerance_um,
                 "surface tolerance of the fine meshes; 0: as they are")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--ticks", options.ticks, "number of ticks, 1 ms apart")
      ->check(CLI::Range(10, 1000000))
      ->capture_default_str();
  app.add_option("--passes", options.passes, "the time of a tick is the minimum of this number of passes")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "phases of the hand's motion")->capture_default_str();
  app.add_option("--tolerance-um", options.tolerance_um,
                 "a tick is behind if its pose differs from the reference by more [um]")
      ->capture_default_str();
  app.add_option("--cache", options.cache, "directory of the mesh cache; without it each mesh is prepared anew");
  app.add_flag("--same-mesh", options.fine_reference,
               "the reference is the fine mesh itself with unlimited work; slow");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    for (const ConformingCase& of : conforming_cases()) std::cout << of.name << '\n';
    return 0;
  }
  std::printf(
      "%zu ticks, 1 ms apart. behind: differs by more than %g um from the coarse mesh's proxy with unlimited\n"
      "work; lag: longest run of such ticks; diff: largest difference of a pose. dFmax: largest force to the\n"
      "reference's; dF: largest difference at one tick, in %% of the reference's largest force. us: processor\n"
      "time of a tick, minimum of up to %d passes; one core only: %s.\n\n%s\n",
      options.ticks, options.tolerance_um, options.passes, pinned_to_one_core() ? "yes" : "no", kHeader);
  try {
    for (const ConformingCase& of : conforming_cases())
      if (selected(of, options.cases)) run_case(of, options);
  } catch (const std::exception& error) {
    std::cerr << "bench_conforming: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
