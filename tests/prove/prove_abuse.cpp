// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wrenchd/client.hpp>
#include <wrenchd/state_reader.hpp>

#include "daemon/control/json_rpc.hpp"
#include "daemon/control/listening_socket.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tests/prove/abused_daemon.hpp"
#include "tests/prove/hoarding.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/temporary_directory.hpp"

// Measures how abuse of the control socket affects the servo loop. The real daemon runs, armed by a client
// that keeps its lease, and records every tick. Slices of one second alternate between three conditions: no
// abuse; abuse of the daemon's socket by other processes; and the same abuse of an unrelated socket. The
// third condition costs the machine as much, so the difference is the daemon's own cost. All conditions run
// in one recording, so other load affects them equally. Tick durations and wake latencies come from the
// recording.
//
// Further daemons follow: one whose log and live line nobody reads; one for each signal, which must run on or
// release the hand before it ends; and one that clients try to exhaust (hoarding.hpp).

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// One kind of abuse, repeated until `stop` is set.
using Abuse = void (*)(const fs::path& path, const std::atomic<bool>& wanted);

void floods_requests(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  std::string many;
  for (int i = 0; i < 50; ++i) many += request("describe");
  while (wanted && fd && send_bytes(fd.get(), many)) drain(fd.get());
}

void never_reads(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string line = request("subscribe") + request("status") + request("describe");
  while (wanted && fd && send_bytes(fd.get(), line)) {
  }
}

void floods_rubbish(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string rubbish = std::string(40000, '[') + "\n{\"jsonrpc\":\"2.0\",\n\xff\xfe\n";
  while (wanted && fd && send_bytes(fd.get(), rubbish)) drain(fd.get());
}

void endless_line(const fs::path& path, const std::atomic<bool>& wanted) {
  const std::string piece(65536, 'x');
  while (wanted) {
    const OwnedFd fd = connected(path);
    if (!fd) return;
    for (int i = 0; i < 1600 && wanted && send_bytes(fd.get(), piece); ++i) {
    }
  }
}

void connects(const fs::path& path, const std::atomic<bool>& wanted) {
  std::vector<OwnedFd> kept;
  while (wanted) {
    kept.push_back(connected(path));
    if (kept.size() > 50) kept.clear();
    std::this_thread::sleep_for(100us);
  }
}

void asks_for_all(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string line =
      request("devices") + request("arm") + request("lease.heartbeat") + request("lease.release");
  while (wanted && fd && send_bytes(fd.get(), line)) drain(fd.get());
}

constexpr std::array<Abuse, 6> kAbuses = {floods_requests, never_reads, floods_rubbish,
                                          endless_line,    connects,    asks_for_all};

/// Runs the abusers in a separate process.
class Abusers {
 public:
  /// uid: the user of the abusers, if this process may change its user.
  Abusers(const fs::path& path, int threads, uid_t uid) {
    if (::pipe2(pipe_.data(), O_CLOEXEC) != 0)
      throw std::system_error(errno, std::generic_category(), "pipe");
    pid_ = ::fork();
    if (pid_ == 0 && become(uid)) live(path, threads);
    if (pid_ == 0) ::_exit(1);
    ::close(pipe_[0]);
  }
  ~Abusers() {
    ::close(pipe_[1]);
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Abusers(const Abusers&) = delete;
  Abusers& operator=(const Abusers&) = delete;

  void begin() { tell('b'); }
  void end() { tell('e'); }

 private:
  void tell(char what) { [[maybe_unused]] const ssize_t n = ::write(pipe_[1], &what, 1); }

  [[noreturn]] void live(const fs::path& path, int threads) {
    ::close(pipe_[1]);
    std::atomic<bool> wanted{false};
    for (int i = 0; i < threads; ++i)
      std::thread([&wanted, path, i] {
        while (true) {
          while (!wanted) std::this_thread::sleep_for(1ms);
          kAbuses[static_cast<std::size_t>(i) % kAbuses.size()](path, wanted);
          std::this_thread::sleep_for(1ms);
        }
      }).detach();
    for (char what = 0; ::read(pipe_[0], &what, 1) == 1;) wanted = what == 'b';
    ::_exit(0);
  }

  std::array<int, 2> pipe_{};
  pid_t pid_ = -1;
};

/// An unrelated socket in a separate process, which accepts every connection and reads all input.
class Decoy {
 public:
  explicit Decoy(const fs::path& path) : listens_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof address.sun_path - 1);
    if (::bind(listens_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listens_.get(), 64) != 0)
      throw std::system_error(errno, std::generic_category(), path.string());
    fs::permissions(path, fs::perms::all);
    pid_ = ::fork();
    if (pid_ == 0) live();
  }
  ~Decoy() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Decoy(const Decoy&) = delete;
  Decoy& operator=(const Decoy&) = delete;

 private:
  [[noreturn]] void live() const {
    std::vector<pollfd> peers = {{listens_.get(), POLLIN, 0}};
    std::array<char, 65536> bytes;
    while (::poll(peers.data(), peers.size(), -1) > 0 || errno == EINTR) {
      for (std::size_t i = peers.size() - 1; i > 0; --i) {
        if (peers[i].revents == 0) continue;
        const ssize_t got = ::recv(peers[i].fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
        if (got > 0 || (got < 0 && errno == EAGAIN)) continue;
        ::close(peers[i].fd);
        peers.erase(peers.begin() + static_cast<std::ptrdiff_t>(i));
      }
      if (peers[0].revents == 0) continue;
      const int peer = ::accept4(listens_.get(), nullptr, nullptr, SOCK_CLOEXEC);
      if (peer >= 0) peers.push_back({peer, POLLIN, 0});
    }
    ::_exit(1);
  }

  OwnedFd listens_;
  pid_t pid_ = -1;
};

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

/// An armed daemon that gets a signal. The memory with its ticks outlives the daemon, so that the last tick
/// shows whether the hand was released.
class Signalled {
 public:
  Signalled(const std::string& program, const fs::path& directory, int signal)
      : signal_(signal),
        socket_(directory / ("signal-" + std::to_string(signal) + ".sock")),
        daemon_(program, {"--realtime", "off", "--arm", "--control", socket_},
                directory / ("signal-" + std::to_string(signal) + ".log")) {}

  /// Waits for force, and sends the signal. Returns false if the loop is not armed in time, or has latched a
  /// fault, as on a busy machine.
  bool send() try {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (!connected(socket_) && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(5ms);
    client_.emplace(socket_);
    reader_.emplace(client_->open_state());
    while (client_->state() != "active") {
      if (client_->state() == "fault" || std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(5ms);
    }
    daemon_.signal(signal_);
    return true;
  } catch (const ClientError&) {  // the daemon did not open its socket in time
    return false;
  }
  /// Returns whether the daemon still runs, or has released the hand before it ended.
  bool is_safe() {
    if (!daemon_.ends_within(1s)) return ++survived, true;
    TickState newest;
    try {
      while (reader_->next(newest, 0ms)) {
      }
    } catch (const ClientError&) {  // the daemon has ended
    }
    return newest.state() == "shutdown" && newest.integer("released") == 1 &&
           newest.integer("motors_commanded") == 0;
  }
  int signal() const { return signal_; }

  static inline long survived = 0;  ///< daemons that ran on

 private:
  int signal_;
  fs::path socket_;
  Daemon daemon_;
  std::optional<Client> client_;
  std::optional<StateReader> reader_;
};

struct Walk {
  long signals = 0, survived = 0, not_armed = 0, unreleased = 0;
};

/// Sends every signal to an armed daemon, a few daemons at a time.
Walk walk_signals(const std::string& program, const fs::path& directory) {
  constexpr std::size_t kAtOnce = 4;
  Walk walk;
  std::vector<int> all;
  for (int signal = 1; signal <= SIGRTMAX; ++signal)
    if (signal != SIGKILL && signal != SIGSTOP && (signal <= SIGSYS || signal >= SIGRTMIN))
      all.push_back(signal);
  for (std::size_t begin = 0; begin < all.size(); begin += kAtOnce) {
    std::vector<std::unique_ptr<Signalled>> some;
    for (std::size_t i = begin; i < std::min(begin + kAtOnce, all.size()); ++i)
      some.push_back(std::make_unique<Signalled>(program, directory, all[i]));
    for (auto& one : some)
      if (!one->send()) one.reset(), ++walk.not_armed;
    for (auto& one : some) {
      if (!one) continue;
      ++walk.signals;
      if (one->is_safe()) continue;
      ++walk.unreleased;
      std::fprintf(stderr, "prove_abuse: signal %d ended the daemon, and the hand was not released\n",
                   one->signal());
    }
  }
  walk.survived = Signalled::survived;
  return walk;
}

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
  int threads = 12;
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
  app.add_option("--seed", seed, "seed of the order within a round")->capture_default_str();
  app.add_option("--wrenchd", program, "path of the daemon")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    const test::TemporaryDirectory files;
    const fs::path socket = files.path() / "control.sock", recording = files.path() / "run.h5";
    // Every user may observe, so that abusers without any role can use every method that reads.
    const fs::path config = files.write("wrenchd.toml", "[control]\nobservers = \"*\"\n");
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
    // An emergency stop by an unprivileged user during the abuse.
    abusers.begin();
    std::this_thread::sleep_for(200ms);
    const auto stop_requested = std::chrono::steady_clock::now();
    watcher.call("stop");
    const double stop_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - stop_requested).count();
    abusers.end();
    std::this_thread::sleep_for(100ms);
    if (watcher.state() != "stopped") violation("stop did not stop it");
    if (daemon.end() == -1) violation("the daemon ended by a signal");
    const StalledReader stalled = stall_reader(program, files.path());
    if (stalled.end_ms > kMostEnd_ms && violations == 0) test::MachineLoad().throw_if_busy();
    if (stalled.end_ms > kMostEnd_ms) violation("a stalled reader of the log delays the end of the daemon");
    const Walk walk = walk_signals(program, files.path());
    violations += walk.unreleased;
    const Hoarding hoarding = hoard(program, files.path());
    for (const std::string& what : hoarding.violations) violation(what);
    // The daemon shares the machine, so it may receive a timely heartbeat late. The abusers are idle by now,
    // so the measurement does not include their load.
    if (holder.lost_in_time() > 0) {
      if (violations == 0) test::MachineLoad().throw_if_busy();
      violation("a holder with timely heartbeats lost the lease");
    }

    std::array<Times, kKinds> times;
    for (const TickRecord& record : read_recording(recording).ticks)
      for (const Slice& slice : done)
        if (record.now_ns >= slice.begin_ns && record.now_ns < slice.end_ns) {
          std::int64_t took_ns = 0;
          for (const std::int64_t stage : record.stage_ns) took_ns += stage;
          times[slice.kind].tick_us.push_back(1e-3 * static_cast<double>(took_ns));
          times[slice.kind].late_us.push_back(1e-3 * static_cast<double>(record.wake_latency_ns));
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
        " signals %ld survived %ld not_armed %ld unreleased %ld stalled_status_ms %.1f stalled_stop_ms %.1f "
        "stalled_end_ms %.1f",
        walk.signals, walk.survived, walk.not_armed, walk.unreleased, stalled.slowest_status_ms,
        stalled.stop_ms, stalled.end_ms);
    std::printf(
        " fds %ld fd_stop_ms %.1f starved %ld asked %ld races %ld adds %ld leaks %ld big_mesh_end_ms %.0f",
        hoarding.most_fds, hoarding.stop_ms, hoarding.refused, hoarding.asked, hoarding.swaps, hoarding.adds,
        hoarding.leaks, hoarding.end_ms);
    std::printf(
        " slowest_answer_ms %.1f stop_ms %.1f longest_beat_ms %.1f lost_leases %ld violations %ld seed "
        "%llu\n",
        slowest_answer_ms, stop_ms, holder.worst_ms(), holder.lost(), violations,
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
