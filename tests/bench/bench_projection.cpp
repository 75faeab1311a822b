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
  std::cout
      << "Each of " << effort.poses << " poses, 1 ms apart, is timed separately; its time is the minimum of "
      << effort.passes << " passes.\n"
      << "The methods alternate by pass. p50 to max: quantiles over the poses. spread: of the p50 of the "
         "passes.\n"
      << "The cost of a clock reading, "
      << fixed(static_cast<double>(scale.overhead_counts) * scale.ns_per_count, 0)
      << " ns, is subtracted; one core only: "
      << (pinned_to_one_core() ? "yes" : "NO, so the times are noisy") << ".\n\n"
      << "Half-space: a body of 0.1 m moves at 0.2 m/s and 1 rad/s. bowl N: N vertices below the plane at\n"
      << "different depths. face N: the N corners of a flat face at nearly equal depths. cold:\n"
      << "ExactProjection from p without history. warm: with the rotation and the active contacts of the\n"
      << "previous pose. follow, and all methods that are not exact: PenetrationDepth::follow(), as in the\n"
      << "servo loop. planar 47: each contact in 47 planes, followed by a translation that frees the whole\n"
      << "body. / cold, / warm, / follow: p50 relative to that row. Optimum: PenetrationDepth::query(),\n"
      << "exact.\n\n"
      << "Convex on convex: wrenchd runs warm, as in the servo loop: exact over SE(3), translational over\n"
      << "translations. The peers compute translations without history. They are the packaged binaries\n"
      << "without a broad phase; Bullet works in centimetres; libccd has a support function that tests "
         "every\n"
      << "vertex. Exact depth: all separating axes. right: at 99 % of the poses, the method misses no "
         "overlap\n"
      << "and its depth error is at most 1e-3. above translation: follow() stays on its side of an "
         "obstacle,\n"
      << "so its answer can cost more than the best translation if p passes below an edge.\n";
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
      std::cout << "\nno rows of " << name << ": the build did not find its package\n";
    for (const Table& table : bench_convex(options.effort, scale, peers)) show(table);
  }
  return tables;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool quick = false;
  CLI::App app{"Times each projection method, and the convex queries beside other libraries."};
  app.add_option("--poses", options.effort.poses, "number of poses per path")->check(CLI::Range(10, 100000));
  app.add_option("--passes", options.effort.passes, "number of timed passes")->check(CLI::Range(1, 1000));
  app.add_option("--csv", options.csv, "also write the tables to this file");
  auto* half_space = app.add_flag("--half-space", options.half_space_only, "half-spaces only");
  app.add_flag("--convex", options.convex_only, "convex on convex only")->excludes(half_space);
  app.add_flag("--quick", quick, "smoke test with a few poses of the small cases; the times are meaningless");
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
