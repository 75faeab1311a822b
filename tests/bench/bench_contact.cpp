// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "tests/bench/contact_bench.hpp"

namespace {

using namespace wrenchd::bench;

struct Options {
  Effort effort = {1000, 5, false};
  bool growth_only = false;
  std::filesystem::path csv;
};

/// Prints what the tables compare, so that their times can be interpreted.
void explain(const Effort& effort, const CounterScale& scale) {
  std::cout
      << "Every pose is timed on its own, " << effort.poses
      << " of them a millisecond apart; its time is the "
      << "least of " << effort.passes << " passes.\n"
      << "Methods take turns pass by pass. p50 to max are over the poses. spread: of the passes' p50.\n"
      << "A reading of the clock takes "
      << fixed(static_cast<double>(scale.overhead_counts) * scale.ns_per_count, 0)
      << " ns, which is taken off; one core only: " << (pinned_to_one_core() ? "yes" : "NO, so expect noise")
      << ".\n\n"
      << "all pairs: every pair of triangles that meets at p, found anew. whole tick: from last tick's proxy "
         "to\n"
      << "this one's: contacts, projection, verification and wrench. The peers list contacts at p, and know\n"
      << "nothing of projections; they are the packaged binaries as shipped, without a broad phase; Bullet "
         "in\n"
      << "centimetres; CGAL stops at the first pair. wrong at: poses where the number of pairs is not that "
         "of\n"
      << "exact arithmetic; peers may report one contact for several pairs. overlapping at q: likewise "
         "exact.\n";
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool quick = false;
  CLI::App app{"Times contacts between meshes, and the whole tick, beside other libraries."};
  app.add_option("--poses", options.effort.poses, "poses of each path")->check(CLI::Range(10, 100000));
  app.add_option("--passes", options.effort.passes, "timed passes")->check(CLI::Range(1, 1000));
  app.add_option("--csv", options.csv, "write the tables to this file too");
  app.add_flag("--growth", options.growth_only, "only how the cost grows with the number of triangles");
  app.add_flag("--quick", quick, "a few poses of the small cases: does it run? The times mean nothing");
  CLI11_PARSE(app, argc, argv);
  if (quick) options.effort = {20, 1, true};
  try {
    const CounterScale scale = calibrate_counter();
    explain(options.effort, scale);
    std::vector<Table> tables;
    if (!options.growth_only) {
      std::vector<std::string> missing;
      const std::vector<PeerModule> peers = load_peers(mesh_peers(), missing);
      for (const std::string& name : missing)
        std::cout << "\nno rows of " << name << ": its package was not found when this was built\n";
      tables = bench_meshes(options.effort, scale, peers);
    }
    tables.push_back(bench_growth(options.effort, scale));
    for (const Table& table : tables) table.print(std::cout);
    if (!options.csv.empty()) write_csv(options.csv, tables);
  } catch (const std::exception& error) {
    std::cerr << "bench_contact: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
