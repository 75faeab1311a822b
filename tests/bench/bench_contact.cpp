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
  std::vector<std::filesystem::path> peers;
  std::string only;
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
      << "all pairs: all triangle pairs that intersect at p, without history. whole tick: from the previous\n"
      << "proxy pose to the next: contacts, projection, verification and wrench. The peers list contacts at "
         "p\n"
      << "and have no projection. They are the packaged binaries without a broad phase; Bullet works in\n"
      << "centimetres; CGAL stops at the first pair. wrong at: number of poses with a number of pairs that\n"
      << "differs from exact arithmetic; peers may report one contact for several pairs. overlapping at q:\n"
      << "also in exact arithmetic. Where meshes conform (flat, bore, gears), the peers solve only some of "
         "the "
         "poses.\n\n"
      << "work: a node visit reads a box and a node or leaf of the BVH; touched: an upper bound of the "
         "bytes, "
         "every\n"
      << "visit reading a leaf that no other visit reads; read rate: touched bytes by time, beside what "
         "this\n"
      << "machine reads from memory in sequence. Far below it, arithmetic is the limit, not memory.\n";
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  bool quick = false;
  CLI::App app{"Times contacts between meshes, and the whole tick, beside other libraries."};
  app.add_option("--poses", options.effort.poses, "number of poses per path")->check(CLI::Range(10, 100000));
  app.add_option("--passes", options.effort.passes, "number of timed passes")->check(CLI::Range(1, 1000));
  app.add_option("--csv", options.csv, "also write the tables to this file");
  app.add_option("--peer", options.peers,
                 "also the peer library of this module, which exports the functions of peer_interface.h")
      ->check(CLI::ExistingFile);
  app.add_option("--only", options.only, "only cases whose name contains this text");
  app.add_flag("--growth", options.growth_only, "only the cost by the number of triangles");
  app.add_flag("--quick", quick, "smoke test with a few poses of the small cases; the times are meaningless");
  CLI11_PARSE(app, argc, argv);
  if (quick) options.effort = {20, 1, true};
  try {
    const CounterScale scale = calibrate_counter();
    explain(options.effort, scale);
    std::vector<Table> tables;
    if (!options.growth_only) {
      std::vector<std::string> missing;
      std::vector<PeerModule> peers = load_peers(mesh_peers(), missing);
      for (const std::filesystem::path& file : options.peers)
        peers.emplace_back(std::filesystem::absolute(file));
      for (const std::string& name : missing)
        std::cout << "\nno rows of " << name << ": the build did not find its package\n";
      tables = bench_meshes(options.effort, scale, peers, options.only);
    }
    if (options.only.empty()) tables.push_back(bench_growth(options.effort, scale));
    for (const Table& table : tables) table.print(std::cout);
    if (!options.csv.empty()) write_csv(options.csv, tables);
  } catch (const std::exception& error) {
    std::cerr << "bench_contact: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
