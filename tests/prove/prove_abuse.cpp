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

#include "daemon/control/json_rpc.hpp"
#include "daemon/control/listening_socket.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/temporary_directory.hpp"

// Measures how abuse of the control socket affects the servo loop. The real daemon runs, armed by a client
// that keeps its lease, and records every tick. Slices of one second alternate between three conditions: no
// abuse; abuse of the daemon's socket by other processes; and the same abuse of an unrelated socket. The
// third condition costs the machine as much, so the difference is the daemon's own cost. All conditions run
// in one recording, so other load affects them equally. Tick durations and wake latencies come from the
// recording.

namespace {

using namespace wrenchd;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

std::string request(const std::string& method) {
  return R"({"jsonrpc":"2.0","id":1,"method":")" + method + "\"}\n";
}

OwnedFd connected(const fs::path& path) {
  OwnedFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(address.sun_path, sizeof address.sun_path - 1);
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return {};
  return fd;
}

/// Sends as many bytes as possible without a long wait. Returns false if the peer is gone.
bool send_bytes(int fd, const std::string& bytes) {
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t more = ::send(fd, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (more > 0) {
      sent += static_cast<std::size_t>(more);
    } else if (errno == EAGAIN) {
      std::this_thread::sleep_for(200us);
      return true;
    } else {
      return false;
    }
  }
  return true;
}

void drain(int fd) {
  std::array<char, 65536> bytes;
  while (::recv(fd, bytes.data(), bytes.size(), MSG_DONTWAIT) > 0) {
  }
}

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

/// Requests descriptors on many connections, and receives none of them.
void hoards_descriptors(const fs::path& path, const std::atomic<bool>& wanted) {
  const std::string line = request("state.open") + request("scene.geometry");
  while (wanted) {
    std::vector<OwnedFd> kept;
    for (int i = 0; i < 31 && wanted; ++i) {
      kept.push_back(connected(path));
      for (int k = 0; k < 20 && kept.back() && send_bytes(kept.back().get(), line); ++k) {
      }
    }
    for (int i = 0; i < 100 && wanted; ++i) std::this_thread::sleep_for(1ms);
  }
}

/// Keeps the queue of slow work full.
void fills_queue(const fs::path& path, const std::atomic<bool>& wanted) {
  while (wanted) {
    std::vector<OwnedFd> kept;
    for (int i = 0; i < 20 && wanted; ++i) {
      kept.push_back(connected(path));
      if (kept.back()) send_bytes(kept.back().get(), request("scene.get") + request("devices"));
    }
    for (int i = 0; i < 5 && wanted; ++i) std::this_thread::sleep_for(1ms);
  }
}

constexpr std::array<Abuse, 8> kAbuses = {floods_requests, never_reads,  floods_rubbish,     endless_line,
                                          connects,        asks_for_all, hoards_descriptors, fills_queue};

/// Runs the abusers in a separate process.
class Abusers {
 public:
  /// uid: the user of the abusers, if this process may change its user.
  Abusers(const fs::path& path, int threads, uid_t uid) {
    if (::pipe2(pipe_.data(), O_CLOEXEC) != 0)
      throw std::system_error(errno, std::generic_category(), "pipe");
    pid_ = ::fork();
    if (pid_ == 0 && (geteuid() != 0 || (setgroups(0, nullptr) == 0 && setgid(uid) == 0 && setuid(uid) == 0)))
      live(path, threads);
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

class Daemon {
 public:
  Daemon(const std::string& program, std::vector<std::string> words, const fs::path& log) {
    words.insert(words.begin(), program);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                     0600);
    const int error = posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::system_error(error, std::generic_category(), program);
  }
  ~Daemon() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  bool lives() const { return ::waitpid(pid_, nullptr, WNOHANG) == 0; }
  /// Ends the process. Returns its exit code; -1 if a signal ended it.
  int end() {
    ::kill(pid_, SIGTERM);
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
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
    constexpr uid_t kNobody = 65534;
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
