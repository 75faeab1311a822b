// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>
#include <sched.h>

#include "tests/bench/convex_bench.hpp"
#include "tests/bench/half_space_bench.hpp"
#include "tests/bench/peer.hpp"

namespace {

using namespace wrenchd::bench;

struct Options {
  Effort effort;
  bool half_space_only = false;
  bool convex_only = false;
  std::filesystem::path csv;
};

/// Prints what the tables compare, so that their times can be interpreted.
void explain(const Effort& effort, const CounterScale& scale) {
  std::cout << "Every pose is timed on its own, " << effort.poses
            << " of them a millisecond apart; its time is the "
            << "least of " << effort.passes << " passes.\n"
            << "Methods take turns pass by pass. p50 to max are over the poses. spread: of the passes' p50.\n"
            << "A reading of the clock takes "
            << fixed(static_cast<double>(scale.overhead_counts) * scale.ns_per_count, 0)
            << " ns, which is taken off; one core only: "
            << (pinned_to_one_core() ? "yes" : "NO, so expect noise") << ".\n\n"
            << "Half-space: a body of 0.1 m moves at 0.2 m/s and 1 rad/s. bowl N: N vertices below the "
               "plane, no two\n"
            << "equally deep; face N: the N corners of a flat face, nearly equally deep. cold: "
               "ExactProjection from p,\n"
            << "knowing nothing. warm: the same with the last pose's rotation and carrying contacts. follow, "
               "and all\n"
            << "that is not exact: PenetrationDepth::follow(), as the servo loop calls it. planar 47: each "
               "contact in\n"
            << "47 planes, then lifted until the whole body is free. / cold, / warm, / follow: p50 over that "
               "row's.\n"
            << "Optimum: PenetrationDepth::query(), exact.\n\n"
            << "Convex on convex: wrenchd warm, as in the servo loop: exact over SE(3), translational over\n"
            << "translations. The peers answer for translations only, and know nothing of the pose before; "
               "they are\n"
            << "the packaged binaries as shipped, without a broad phase; Bullet in centimetres; libccd with "
               "a support\n"
            << "function that looks at every vertex. Exact depth: all separating axes. right: no overlap "
               "missed and\n"
            << "no depth off by more than 1e-3, but for one pose in a hundred. above translation: follow() "
               "keeps to the\n"
            << "side it came from, so where p passes under an edge its answer can cost more than the best "
               "translation.\n";
}

std::vector<Table> measure(const Options& options, const CounterScale& scale) {
  std::vector<Table> tables;
  const auto show = [&](const Table& table) {
    table.print(std::cout);
    tables.push_back(table);
  };
  if (!options.convex_only) {
    for (const Table& table : bench_half_space(options.effort, scale)) show(table);
    show(bench_planar_family(options.effort, scale));
  }
  if (!options.half_space_only) {
    std::vector<std::string> missing;
    const std::vector<PeerModule> peers = load_peers(convex_peers(), missing);
    for (const std::string& name : missing)
      std::cout << "\nno rows of " << name << ": its package was not found when this was built\n";
    for (const Table& table : bench_convex(options.effort, scale, peers)) show(table);
  }
  return tables;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool quick = false;
  CLI::App app{"Times the projection, method by method, and the convex queries against other libraries."};
  app.add_option("--poses", options.effort.poses, "poses of each path")->check(CLI::Range(10, 100000));
  app.add_option("--passes", options.effort.passes, "timed passes")->check(CLI::Range(1, 1000));
  app.add_option("--csv", options.csv, "write the tables to this file too");
  auto* half_space = app.add_flag("--half-space", options.half_space_only, "half-spaces only");
  app.add_flag("--convex", options.convex_only, "convex on convex only")->excludes(half_space);
  app.add_flag("--quick", quick, "a few poses of the small cases: does it run? The times mean nothing");
  CLI11_PARSE(app, argc, argv);
  if (quick) options.effort = {20, 1, true};
  try {
    const CounterScale scale = calibrate_counter();
    explain(options.effort, scale);
    const std::vector<Table> tables = measure(options, scale);
    if (!options.csv.empty()) write_csv(options.csv, tables);
  } catch (const std::exception& error) {
    std::cerr << "bench_projection: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
