// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "tests/bench/statistics.hpp"
#include "tests/bench/stopwatch.hpp"
#include "tests/bench/table.hpp"
#include "tests/bench/trajectory_run.hpp"
#include "tests/support/conforming_scene.hpp"

// Conforming contact of fine meshes: the proxy of each fine mesh is compared on every tick with the proxy of
// a coarse mesh of the same shape, which has unlimited work.

namespace {

using namespace wrenchd;
using namespace wrenchd::bench;
using namespace wrenchd::test;

struct Options {
  std::vector<std::string> cases;
  std::size_t ticks = 2200;
  int passes = 2;
  std::uint64_t seed = 1;
  double tolerance_um = 2.0, surface_tolerance_um = 1.0;
  std::filesystem::path cache, csv;
  bool list = false;
  bool fine_reference = false;
};

const std::vector<std::string>& columns() {
  static const std::vector<std::string> all = {"load s",  "spent %", "behind %", "lag ms", "lag mm",
                                               "diff um", "p50 us",  "p99 us",   "max us", ">1ms %",
                                               "F max N", "dFmax %", "dF %",     "visits"};
  return all;
}

constexpr int kNameWidth = 58, kCellWidth = 9;

void print_cells(const std::string& name, const std::vector<std::string>& cells) {
  std::printf("%-*s", kNameWidth, name.c_str());
  for (const std::string& cell : cells) std::printf("%*s", kCellWidth, cell.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

std::vector<std::string> cells_of(double load_s, const std::vector<ProxyTick>& run, const LagReport& lag) {
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
  return {fixed(load_s, 2),
          fixed(100.0 * share_of(run, ProjectionStatus::budget_spent), 1),
          fixed(100.0 * lag.behind_share, 1),
          whole(lag.longest_ticks),
          fixed(1e3 * lag.longest_run_m, 2),
          fixed(1e6 * lag.largest_m, 1),
          fixed(times.p50, 0),
          fixed(times.p99, 0),
          fixed(times.max, 0),
          fixed(100.0 * static_cast<double>(late) / static_cast<double>(run.size()), 1),
          fixed(lag.force_N, 3),
          fixed(per_force * (lag.force_N - lag.reference_force_N), 2),
          fixed(per_force * lag.force_difference_N, 2),
          whole(visits)};
}

void run_case(const ConformingCase& of, const Options& options, Table& table) {
  MeshLoader loader(options.cache, {});
  const ConformingScene fine = load_scene(of, fine_meshes(of), loader, 1e-6 * options.surface_tolerance_um);
  const ConformingScene coarse = load_coarse_scene(of);
  const ConformingScene& reference_scene = options.fine_reference ? fine : coarse;
  const std::vector<Pose> X_WC = conforming_trajectory(of, options.ticks, options.seed);
  const auto run = follow_trajectory(fine.scene, {}, body_poses(fine, X_WC), options.passes);
  const auto reference =
      follow_trajectory(reference_scene.scene, unlimited_work(), body_poses(reference_scene, X_WC));
  const LagReport lag = compare(run, fine.X_TC, reference, reference_scene.X_TC, box_corners(coarse.tool_F),
                                1e-6 * options.tolerance_um);
  const std::vector<std::string> cells = cells_of(fine.load_s, run, lag);
  print_cells(of.name, cells);
  table.add(of.name, "whole tick", cells);
  for (const std::string& text : loader.simplifications())
    std::printf("  %s\n", text.substr(text.rfind('/') + 1).c_str());
  const double infeasible = share_of(run, ProjectionStatus::infeasible);
  if (infeasible > 0.0) std::printf("  infeasible: %.1f %% of the ticks\n", 100.0 * infeasible);
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
  app.add_option("--csv", options.csv, "also write the table to this file");
  app.add_option("--cache", options.cache,
                 "directory of the mesh cache; without it each mesh is prepared anew");
  app.add_flag("--same-mesh", options.fine_reference,
               "the reference is the fine mesh itself with unlimited work; slow");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    for (const ConformingCase& of : conforming_cases()) std::cout << of.name << '\n';
    return 0;
  }
  std::printf(
      "%zu ticks, 1 ms apart. behind: differs by more than %g um from the coarse mesh's proxy with "
      "unlimited\n"
      "work; lag: longest run of such ticks; diff: largest difference of a pose. dFmax: largest force to "
      "the\n"
      "reference's; dF: largest difference at one tick, in %% of the reference's largest force. us: "
      "processor\n"
      "time of a tick, minimum of up to %d passes; one core only: %s.\n\n",
      options.ticks, options.tolerance_um, options.passes, pinned_to_one_core() ? "yes" : "no");
  print_cells("case", columns());
  Table table("conforming contact", columns());
  try {
    for (const ConformingCase& of : conforming_cases())
      if (selected(of, options.cases)) run_case(of, options, table);
    if (!options.csv.empty()) write_csv(options.csv, {table});
  } catch (const std::exception& error) {
    std::cerr << "bench_conforming: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
