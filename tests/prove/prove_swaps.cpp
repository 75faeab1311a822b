// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "config/toml_file.hpp"
#include "daemon/realtime.hpp"
#include "daemon/runtime.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/invariants.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

// Changes the rendering thousands of times, half of the changes invalid, while the real loop runs in wall
// time and a simulated hand presses. The program checks every tick: the rendering in use must be one that was
// published, and every wrench must respect its limits and its slew rate. Slices with and without changes
// alternate in one run and have separate timing, so that other load affects both equally.

namespace {

using namespace wrenchd;
namespace fs = std::filesystem;

struct Times {
  std::vector<double> tick_us, late_us;

  static double quantile(std::vector<double>& x, double share) {
    if (x.empty()) return 0.0;
    std::sort(x.begin(), x.end());
    return x[std::min(x.size() - 1, static_cast<std::size_t>(share * static_cast<double>(x.size())))];
  }
  void print(const char* name) {
    std::printf(
        "%s ticks %zu tick_p50_us %.1f tick_p999_us %.1f tick_max_us %.1f wake_p50_us %.1f wake_p999_us %.1f "
        "wake_max_us %.1f late_ticks %zu\n",
        name, tick_us.size(), quantile(tick_us, 0.5), quantile(tick_us, 0.999), quantile(tick_us, 1.0),
        quantile(late_us, 0.5), quantile(late_us, 0.999), quantile(late_us, 1.0),
        static_cast<std::size_t>(
            std::count_if(late_us.begin(), late_us.end(), [](double us) { return us > 1000.0; })));
  }
};

RunConfig plan_of() {
  RunConfig plan = load_run_config({test::source_path("config/wrenchd.toml"), {}, {}, false},
                                   SearchPath({test::source_path("config")}));
  plan.settings.servo.realtime = Realtime::best_effort;
  plan.settings.servo.self_test_s = 0.0;
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.065}, Vector3d::Zero()},
                                        {0.4, {0, 0, 0.065}, Vector3d::Zero()},
                                        {0.8, {0, 0, 0.017}, Vector3d::Zero()},
                                        {1.5, {0.01, 0.01, 0.015}, {0.1, 0.1, 0.0}},
                                        {2.0, {0, 0, 0.065}, Vector3d::Zero()}};
  return plan;
}

/// Requests one random change at a time.
class Asker {
 public:
  Asker(Reconfigurator& bench, const fs::path& directory, std::uint64_t seed)
      : bench_(bench), directory_(directory), engine_(seed) {}

  /// Returns true if the daemon accepted the change.
  bool ask(bool good) {
    const std::string gain = good ? to_text(between(1000.0, 4500.0)) : "-1.0";
    try {
      switch (static_cast<int>(between(0.0, 5.0))) {
        case 0:
          bench_.replace_scene(scene(good));
          return true;
        case 1:
          bench_.set_rendering(toml("[wrench]\nenergy_stiffness_per_s2 = " + gain), "ask");
          return true;
        case 2:
          bench_.move_obstacle(good ? "block" : "blok",
                               {Quaterniond::Identity(), {between(-0.08, 0.08), between(-0.08, 0.08), 0.0}},
                               0.5);
          return true;
        case 3:
          bench_.remove_obstacle(good ? "block" : "blok");
          return true;
        default:
          bench_.reload([&] {
            RunConfig plan = plan_of();
            change_rendering(toml("[wrench]\nenergy_stiffness_per_s2 = " + gain), "ask", plan.settings);
            plan.scene = load_scene(scene(good));
            return plan;
          });
          return true;
      }
    } catch (const std::exception&) {
      return false;
    }
  }

 private:
  double between(double low, double high) { return std::uniform_real_distribution(low, high)(engine_); }
  static TomlNode toml(const std::string& text) { return read_toml_text(text, "ask"); }

  fs::path scene(bool good) {
    const std::string mesh = test::source_path("config/meshes/cube.off");
    const fs::path file = directory_ / ("scene" + std::to_string(++scenes_ % 4) + ".toml");
    std::ofstream out(file);
    out << "[tool]\nmesh = \"" << mesh << "\"\nscale = 0.001\nmass = 0.2\n"
        << "[[obstacle]]\nname = \"table\"\nhalf_space = { normal = [0, 0, " << (good ? 1 : 0)
        << "], offset = 0 }\n"
        << "[[obstacle]]\nname = \"block\"\nmesh = \"" << mesh << "\"\nscale = 0.001\nposition_m = ["
        << between(-0.08, 0.08) << ", " << between(-0.08, 0.08) << ", -0.02]\n";
    return file;
  }

  Reconfigurator& bench_;
  fs::path directory_;
  std::mt19937_64 engine_;
  int scenes_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Changes the rendering many times, half of the changes invalid, while the real loop runs.");
  int changes = 10000;
  std::uint64_t seed = 1;
  app.add_option("--changes", changes)->capture_default_str()->check(CLI::Range(10, 10000000));
  app.add_option("--seed", seed)->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const test::MachineLoad load;
  const test::TemporaryDirectory directory;
  const RunConfig plan = plan_of();
  for (const RealtimeGrant& grant : lock_memory(plan.settings.servo.realtime))
    std::printf("%s: %s\n", grant.granted ? "granted" : "denied", grant.request.c_str());
  WallClock clock;
  SimulatedDevice simulated(plan.profile, plan.settings.simulation);
  LoopbackLink link(simulated, clock, plan.settings.simulation);
  Runtime runtime(plan, link, clock);
  runtime.open();

  std::map<std::uint32_t, std::uint64_t> sums;  // checksums of the published renderings, by id
  std::mutex sums_mutex;
  std::atomic<bool> changing{false}, over{false};
  Times with, without;
  test::Invariants invariants({plan.profile.max_force_N, plan.profile.max_torque_Nm,
                               plan.settings.limits.force_slew_N_per_s,
                               plan.settings.limits.torque_slew_Nm_per_s, 1e-3, 20e-3});
  const SharedState& state = runtime.enable_shared_state();
  std::uint64_t missed = 0;
  std::uint64_t torn = 0, unknown = 0, broken = 0, in_contact = 0, loop_faults = 0;
  std::atomic<std::uint64_t> pushed{0};
  std::set<std::uint32_t> active_ids;  // ids of the renderings in the records
  std::vector<TickRecord> waiting;     // records whose rendering is not in `sums` yet
  const auto judge = [&](const TickRecord& r) {
    const std::lock_guard lock(sums_mutex);
    const auto sum = sums.find(r.rendering_id);
    if (sum == sums.end()) return false;
    torn += sum->second == r.rendering_checksum ? 0 : 1;
    return true;
  };

  std::atomic<bool> stop{false};
  std::thread servo([&] {
    for (const RealtimeGrant& grant : prepare_servo_thread(plan.settings.servo))
      std::printf("%s: %s\n", grant.granted ? "granted" : "denied", grant.request.c_str());
    runtime.loop().run(clock, stop);
  });
  std::thread watcher([&] {
    bool first = true;
    StateRecord seen;
    for (std::uint64_t next = 0; !over.load() || next < state.written();) {
      if (!state.read(next, seen)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const std::uint64_t oldest = state.written() - std::min(state.written(), state.slots() / 2);
        if (next + state.slots() <= state.written()) missed += oldest - next, next = oldest;
        continue;
      }
      ++next;
      const TickRecord& r = seen.tick;
      if (first) {
        const std::lock_guard lock(sums_mutex);
        sums[0] = r.rendering_checksum;
        first = false;
      }
      if (const auto what = invariants.check(r)) {
        if (++broken < 5) std::printf("broken %s\n", what->c_str());
      }
      double tick_us = 0.0;
      for (const std::int64_t ns : r.stage_ns) tick_us += 1e-3 * static_cast<double>(ns);
      Times& times = changing.load() ? with : without;
      times.tick_us.push_back(tick_us);
      times.late_us.push_back(1e-3 * static_cast<double>(r.wake_latency_ns));
      active_ids.insert(r.rendering_id);
      in_contact += r.contacts > 0 ? 1 : 0;
      pushed += r.F_out[2] > 0.2 ? 1 : 0;
      loop_faults +=
          (r.faults & (bit(Fault::tick_late) | bit(Fault::loop_stalled) | bit(Fault::wrench_late))) != 0;
      if (!judge(r)) waiting.push_back(r);
    }
  });

  Asker asker(runtime.reconfigurator(), directory.path(), seed);
  int applied = 0, rejected = 0, done = 0;
  // Waits until the hand presses, before the first change.
  for (const TimePoint end = clock.now() + std::chrono::seconds(20); pushed == 0 && clock.now() < end;) {
    if (runtime.loop().telemetry().state() == State::disarmed) runtime.loop().requests().arm();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  constexpr int kInARow = 250;
  while (done < changes) {
    // Slices with and without changes have the same duration and alternate.
    changing.store(true);
    const TimePoint began = clock.now();
    for (int i = 0; i < kInARow && done < changes; ++i, ++done) {
      (asker.ask(done % 2 == 0) ? applied : rejected) += 1;
      const auto [number, sum] = runtime.reconfigurator().current_rendering();
      {
        const std::lock_guard lock(sums_mutex);
        if (number > 0) sums[number] = sum;
      }
      if (runtime.loop().telemetry().state() == State::disarmed) runtime.loop().requests().arm();
      if (is_latched(runtime.loop().telemetry().state())) runtime.loop().requests().acknowledge();
    }
    const Duration took = clock.now() - began;
    while (runtime.loop().telemetry().crossfading())
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    changing.store(false);
    std::this_thread::sleep_for(took);
  }
  stop.store(true);
  servo.join();
  over.store(true);
  watcher.join();
  for (const TickRecord& r : waiting) unknown += judge(r) ? 0 : 1;

  const auto number = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::printf(
      "swaps changes %d applied %d rejected %d active %zu torn %llu unknown %llu violations %llu in_contact "
      "%llu "
      "pushed %llu late_or_stopped %llu dropped %llu seed %llu\n",
      changes, applied, rejected, active_ids.size(), number(torn), number(unknown),
      number(broken + torn + unknown), number(in_contact), number(pushed), number(loop_faults),
      number(missed), number(seed));
  with.print("swaps_with");
  without.print("swaps_without");
  if (torn > 0 || unknown > 0 || broken > 0 || applied == 0 || rejected == 0) return 1;
  if (pushed > 0) return 0;
  if (!load.busy()) return 1;
  std::printf("%s\n", load.busy_text().c_str());
  return test::kExitTooBusy;
}
