// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <unistd.h>
#include <wrenchd/client.hpp>

#include "daemon/control/json_rpc.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tests/prove/abused_daemon.hpp"
#include "tests/prove/abusers.hpp"
#include "tests/prove/hoarding.hpp"
#include "tests/prove/signal_walk.hpp"
#include "tests/prove/stop_latency.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/temporary_directory.hpp"

// Measures how abuse of the control socket affects the servo loop. The real daemon runs, armed by a client
// that keeps its lease, and records every tick. Slices of one second alternate between three conditions: no
// abuse; abuse of the daemon's socket by other processes; and the same abuse of an unrelated socket. The
// third condition costs the machine as much, so the difference is the daemon's own cost. All conditions run
// in one recording, so other load affects them equally. Tick durations and wake latencies come from the
// recording.
//
// Then a user without a role stops the armed loop during each kind of abuse (stop_latency.hpp).
//
// Further daemons follow: one whose log and live line nobody reads; one for each signal, which must run on or
// release the hand before it ends; and one that clients try to exhaust (hoarding.hpp).

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Keeps the lease on its own connection and thread. Acquires the lease again if it is lost.
class Holder {
 public:
  explicit Holder(const std::string& path) : client_(path) {
    client_.call("lease.acquire");
    client_.call("arm");
    thread_ = std::jthread([this](const std::stop_token& stop) {
      for (auto last = std::chrono::steady_clock::now(); !stop.stop_requested();) {
        if (!does("lease.heartbeat")) {
          ++lost_;
          if (longest_ < kTooLong) ++wronged_;
          does("acknowledge");  // clears a fault that a busy machine may have caused
          does("lease.acquire");
          does("arm");
          longest_ = {};
        }
        const auto now = std::chrono::steady_clock::now();
        longest_ = std::max<std::chrono::nanoseconds>(longest_, now - last);
        worst_ = std::max(worst_, longest_);
        last = now;
        std::this_thread::sleep_for(10ms);
      }
    });
  }
  void end() {
    thread_.request_stop();
    thread_.join();
  }
  /// After end(): returns the longest interval between two acknowledged heartbeats [ms].
  double worst_ms() const { return 1e-6 * static_cast<double>(worst_.count()); }
  long lost() const { return lost_; }
  /// Returns the number of leases lost although every heartbeat, including its answer, was in time.
  long lost_in_time() const { return wronged_; }

 private:
  static constexpr auto kTooLong = 80ms;  ///< the lease allows 100 ms, and the daemon shares the machine

  bool does(const char* method) try {
    client_.call(method);
    return true;
  } catch (const ClientError&) {
    return false;
  }

  Client client_;
  std::chrono::nanoseconds longest_{0};  ///< longest interval since the lease was acquired
  std::chrono::nanoseconds worst_{0};
  long lost_ = 0, wronged_ = 0;
  std::jthread thread_;
};

struct StalledReader {
  double slowest_status_ms = 0.0, stop_ms = 0.0, end_ms = 0.0;
};

/// Runs a daemon whose standard output and standard error go to a full pipe that nobody reads.
StalledReader stall_reader(const std::string& program, const fs::path& directory) {
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  const OwnedFd read_end(pipe[0]), write_end(pipe[1]);
  ::fcntl(pipe[1], F_SETFL, O_NONBLOCK);
  const std::array<char, 4096> bytes{};
  while (::write(pipe[1], bytes.data(), bytes.size()) > 0) {
  }
  ::fcntl(pipe[1], F_SETFL, 0);
  const fs::path socket = directory / "stalled.sock";
  Daemon daemon(program, {"--realtime", "off", "--live", "--verbose", "--control", socket},
                directory / "stalled.log", pipe[1]);
  for (int i = 0; i < 2000 && !connected(socket); ++i) std::this_thread::sleep_for(5ms);
  Client client(socket);
  const auto measure_ms = [](const auto& call) {
    const auto begin = std::chrono::steady_clock::now();
    call();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  };
  StalledReader result;
  for (int i = 0; i < 200; ++i) {
    result.slowest_status_ms = std::max(result.slowest_status_ms, measure_ms([&] { client.status(); }));
    std::this_thread::sleep_for(5ms);
  }
  result.stop_ms = measure_ms([&] { client.stop(); });
  result.end_ms = measure_ms([&] {
    daemon.signal(SIGTERM);
    daemon.ends_within(10s);
  });
  return result;
}

/// The condition of a slice.
enum Kind : std::size_t { kQuiet, kBusy, kAbused, kKinds };

struct Slice {
  std::int64_t begin_ns, end_ns;
  Kind kind;
};

struct Times {
  std::vector<double> tick_us, late_us;

  static double quantile(std::vector<double>& values, double share) {
    if (values.empty()) return std::nan("");
    const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + at, values.end());
    return values[static_cast<std::size_t>(at)];
  }
};

/// Every user may observe, so that abusers without any role can use every method that reads.
constexpr const char* kConfig = R"([limits]
soft_start_s = 0.25
[simulation]
hand_script = "hand.toml"
[control]
observers = "*"
)";

/// Presses the cube on the table and lifts it, often, so that an armed loop soon has force.
constexpr const char* kHand = R"(
waypoint = [
  { time_s = 0.0, position_m = [0.0, 0.0, 0.028] },
  { time_s = 0.6, position_m = [0.0, 0.0, 0.028] },
  { time_s = 0.8, position_m = [0.0, 0.0, 0.020] },
  { time_s = 1.2, position_m = [0.0, 0.0, 0.020] },
  { time_s = 1.4, position_m = [0.0, 0.0, 0.028] },
]
)";

/// Longest time from SIGTERM to the end of the daemon.
constexpr double kMostEnd_ms = 2000.0;

std::int64_t now_ns() {
  return std::chrono::steady_clock::now().time_since_epoch().count();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("prove_abuse: measures how abuse of the control socket affects the servo loop.");
  long slices = 10;
  double slice_s = 1.0;
  std::uint64_t seed = 1;
  int threads = 12, stops = 3;
  std::string program = (fs::read_symlink("/proc/self/exe").parent_path() / "wrenchd").string();
  app.add_option("--slices", slices, "number of rounds with an idle, a busy and an abused slice each")
      ->check(CLI::Range(1L, 1000000L))
      ->capture_default_str();
  app.add_option("--slice-s", slice_s, "duration of a slice [s]")
      ->check(CLI::Range(0.1, 60.0))
      ->capture_default_str();
  app.add_option("--threads", threads, "number of abusing threads")
      ->check(CLI::Range(1, 200))
      ->capture_default_str();
  app.add_option("--stops", stops, "emergency stops during each kind of abuse")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the order within a round")->capture_default_str();
  app.add_option("--wrenchd", program, "path of the daemon")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    const test::TemporaryDirectory files;
    const fs::path socket = files.path() / "control.sock", recording = files.path() / "run.h5";
    files.write("hand.toml", kHand);
    const fs::path config = files.write("wrenchd.toml", kConfig);
    fs::permissions(files.path(), fs::perms::group_exec | fs::perms::others_exec, fs::perm_options::add);
    Daemon daemon(
        program,
        {"--realtime", "best_effort", "--config", config, "--control", socket, "--record", recording},
        files.path() / "log");
    for (int i = 0; i < 500 && !connected(socket); ++i) std::this_thread::sleep_for(10ms);
    Client watcher(socket);
    for (int i = 0; i < 500 && watcher.state() != "disarmed"; ++i) std::this_thread::sleep_for(10ms);
    if (watcher.state() != "disarmed") {
      test::MachineLoad().throw_if_busy();
      throw std::runtime_error("the daemon is not disarmed 5 s after its start");
    }
    const Decoy decoy(files.path() / "decoy.sock");
    Abusers busy(files.path() / "decoy.sock", threads, kNobody);
    Abusers abusers(socket, threads, kNobody);
    Holder holder(socket);
    long violations = 0;
    const auto violation = [&violations](const std::string& what) {
      ++violations;
      std::fprintf(stderr, "prove_abuse: %s\n", what.c_str());
    };
    std::mt19937_64 random(seed);
    std::vector<Slice> done;
    double slowest_answer_ms = 0.0;
    std::array<Kind, kKinds> round = {kQuiet, kBusy, kAbused};
    for (long i = 0; i < slices; ++i) {
      std::shuffle(round.begin(), round.end(), random);
      for (const Kind kind : round) {
        if (kind == kBusy) busy.begin();
        if (kind == kAbused) abusers.begin();
        std::this_thread::sleep_for(100ms);  // until all abusers are active, or all have ended
        Slice slice{now_ns(), 0, kind};
        const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(slice_s);
        while (std::chrono::steady_clock::now() < until) {
          std::this_thread::sleep_for(20ms);
          const auto asked = std::chrono::steady_clock::now();
          const Json status = Json::parse(watcher.status());
          if (kind == kAbused)
            slowest_answer_ms = std::max(
                slowest_answer_ms,
                std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - asked).count());
          if (status["state"] == "stopped") violation("a client without a stop request stopped it");
        }
        slice.end_ns = now_ns();
        busy.end();
        abusers.end();
        done.push_back(slice);
        if (!daemon.lives()) throw std::runtime_error("the daemon has ended");
      }
    }
    holder.end();
    const std::vector<StopRequest> stop_requests = request_stops(socket, abusers, stops);
    if (daemon.end() == -1) violation("the daemon ended by a signal");
    const StalledReader stalled = stall_reader(program, files.path());
    if (stalled.end_ms > kMostEnd_ms && violations == 0) test::MachineLoad().throw_if_busy();
    if (stalled.end_ms > kMostEnd_ms) violation("a stalled reader of the log delays the end of the daemon");
    const SignalWalk walk = walk_signals(program, config, files.path());
    for (const int signal : walk.unreleased)
      violation("signal " + std::to_string(signal) + " ended the daemon, and the hand was not released");
    const Hoarding hoarding = hoard(program, files.path());
    for (const std::string& what : hoarding.violations) violation(what);
    // The daemon shares the machine, so it may receive a timely heartbeat late. The abusers are idle by now,
    // so the measurement does not include their load.
    if (holder.lost_in_time() > 0) {
      if (violations == 0) test::MachineLoad().throw_if_busy();
      violation("a holder with timely heartbeats lost the lease");
    }

    std::array<Times, kKinds> times;
    const std::vector<TickRecord> ticks = read_recording(recording).ticks;
    for (const TickRecord& record : ticks)
      for (const Slice& slice : done)
        if (record.now_ns >= slice.begin_ns && record.now_ns < slice.end_ns) {
          std::int64_t took_ns = 0;
          for (const std::int64_t stage : record.stage_ns) took_ns += stage;
          times[slice.kind].tick_us.push_back(1e-3 * static_cast<double>(took_ns));
          times[slice.kind].late_us.push_back(1e-3 * static_cast<double>(record.wake_latency_ns));
        }
    for (std::size_t kind = 0; kind <= kAbuseNames.size(); ++kind) {
      const StopLatency stop = stop_latency(stop_requests, kind, ticks);
      if (stop.stops < stops && violations == 0) test::MachineLoad().throw_if_busy();
      if (stop.stops < stops) violation("abuse keeps a user without a role from requesting a stop");
      if (stop.missed > 0) violation("a stop of a user without a role did not stop the loop");
      std::printf("stops_while_%s stops %ld missed %ld p50_ms %.1f max_ms %.1f\n",
                  kind < kAbuseNames.size() ? kAbuseNames[kind] : "all", stop.stops, stop.missed, stop.p50_ms,
                  stop.max_ms);
    }
    constexpr std::array<const char*, kKinds> kNames = {"quiet", "busy", "abused"};
    std::printf("abuse");
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      auto& [tick_us, late_us] = times[kind];
      std::printf(" %s_ticks %zu %s_tick_p50_us %.1f %s_tick_p99_9_us %.1f %s_late_p99_9_us %.1f",
                  kNames[kind], tick_us.size(), kNames[kind], Times::quantile(tick_us, 0.5), kNames[kind],
                  Times::quantile(tick_us, 0.999), kNames[kind], Times::quantile(late_us, 0.999));
    }
    std::printf(
        " signals %ld survived %ld not_armed %ld unreleased %zu stalled_status_ms %.1f stalled_stop_ms %.1f "
        "stalled_end_ms %.1f",
        walk.signals, walk.survived, walk.not_armed, walk.unreleased.size(), stalled.slowest_status_ms,
        stalled.stop_ms, stalled.end_ms);
    std::printf(
        " fds %ld fd_stop_ms %.1f starved %ld asked %ld races %ld adds %ld leaks %ld big_mesh_end_ms %.0f",
        hoarding.most_fds, hoarding.stop_ms, hoarding.refused, hoarding.asked, hoarding.swaps, hoarding.adds,
        hoarding.leaks, hoarding.end_ms);
    std::printf(" slowest_answer_ms %.1f longest_beat_ms %.1f lost_leases %ld violations %ld seed %llu\n",
                slowest_answer_ms, holder.worst_ms(), holder.lost(), violations,
                static_cast<unsigned long long>(seed));
    return violations == 0 ? 0 : 1;
  } catch (const test::TooBusy& busy) {
    std::printf("%s\n", busy.what());
    return test::kExitTooBusy;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "prove_abuse: %s\n", error.what());
    return 1;
  }
}
