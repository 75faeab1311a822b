// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tests/support/gallery_comparison.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/sweep_comparison.hpp"
#include "tools/gallery.hpp"

// Compares wrenchd's contact detection with CGAL's, which decides in exact arithmetic: pair for pair on the
// sweeps of twenty mesh scenes with rough manipulation, and proxy for proxy in the gallery.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

long prove_sweeps(int ticks, std::uint64_t seed, const std::string& only, BodyKind kind) {
  constexpr int kRandomPaths = 3;
  SweepCounts all;
  for (ManipulationCase handling : manipulation_cases()) {
    handling.obstacle_kind = kind;
    if (handling.name.find(only) == std::string::npos) continue;
    const SweepCounts n = compare_sweeps(handling, ticks, kRandomPaths, seed);
    std::printf("%-42s %8ld sweeps %8ld crossed %8ld contacts %7ld touching %6ld overlaps %5ld different\n",
                handling.name.c_str(), n.sweeps, n.crossed, n.contacts, n.touching, n.overlaps, n.different);
    if (!n.first_difference.empty()) std::printf("  %s\n", n.first_difference.c_str());
    std::fflush(stdout);
    all.add(n);
  }
  std::printf("prove_contacts sweeps %ld contacts %ld touching %ld largest_difference %.1e violations %ld\n",
              all.sweeps, all.contacts, all.touching, all.largest_difference, all.different);
  return all.different;
}

void print(const std::string& name, const char* loop, const GalleryComparison& c) {
  std::printf(
      "%-16s %-6s %6ld ticks %6ld in contact %6ld compared %6ld equal bits %5ld above 1e-9, largest %.1e m "
      "%.1e rad; not converged: native %ld (first at %ld), cgal %ld",
      name.c_str(), loop, c.ticks, c.in_contact, c.compared, c.equal_bits, c.different, c.largest_m,
      c.largest_rad, c.native_spent, c.first_native_spent, c.cgal_spent);
  if (c.hands_parted >= 0) std::printf("; hands part at %ld", c.hands_parted);
  if (c.cgal_p50_us > 0.0)
    std::printf("; p50 / p99.9 [us]: native %.0f / %.0f, cgal %.0f / %.0f, %.0f Hz", c.native_p50_us,
                c.native_p999_us, c.cgal_p50_us, c.cgal_p999_us, 1e6 / c.cgal_p999_us);
  std::printf("\n");
  std::fflush(stdout);
}

long prove_gallery(double seconds, const std::string& only) {
  long different = 0;
  for (const GalleryScene& scene : gallery(SearchPath({test::source_path("config")}))) {
    if (scene.name.find(only) == std::string::npos) continue;
    for (const bool closed_loop : {false, true}) {
      const GalleryComparison c = compare_gallery_scene(scene.name, closed_loop, seconds);
      print(scene.name, closed_loop ? "closed" : "open", c);
      different += c.different;
    }
  }
  std::printf("prove_contacts_gallery violations %ld\n", different);
  return different;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("prove_contacts: compares wrenchd's contact detection with CGAL's.");
  int ticks = 100;
  std::uint64_t seed = 1;
  bool in_gallery = false;
  double seconds = 0.0;
  std::string only;
  app.add_option("--cases", ticks, "number of ticks per scene; each tick compares five sweeps")
      ->check(CLI::Range(1, 100000000))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the hand's motion and of the random paths")->capture_default_str();
  app.add_flag(
      "--gallery", in_gallery,
      "compares the proxies in the gallery instead: open loop, where both follow the same poses, and "
      "closed loop, where each hand feels its own forces");
  app.add_option("--seconds", seconds, "maximum duration of a gallery scene; 0: the whole hand script")
      ->check(number_in_range(0, 1e9))
      ->capture_default_str();
  app.add_option("--only", only, "runs only scenes whose name contains this text");
  bool surfaces = false;
  app.add_flag("--surface", surfaces, "the obstacles are surfaces instead of solids");
  CLI11_PARSE(app, argc, argv);
  const long violations =
      in_gallery ? prove_gallery(seconds, only)
                 : prove_sweeps(ticks, seed, only, surfaces ? BodyKind::surface : BodyKind::solid);
  return violations == 0 ? 0 : 1;
}
