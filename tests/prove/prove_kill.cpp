// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "config/load_profile.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/machine_load.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

// Proves that the force ends when the daemon dies. This process emulates the device; the real daemon is a
// child process, which this program kills, crashes and stops at any instant while the hand presses against
// the table. The force on the handle must end when the firmware's watchdog expires. No other sender may keep
// the watchdog alive, a stopped daemon must not apply force when it continues, and a restarted daemon must be
// disarmed. In one variant a tracer halts only the servo thread; then the link's writer thread must send zero
// wrench before the watchdog expires.
//
// All times are those of the emulated device, which observes only what hardware would: commands, or silence.
//
// The daemon needs its rate in wall time to apply force at all. If it raises faults because the machine does
// not give the rate, the program ends with code 77 and the measured figure. A violation is a failure whatever
// the load.

namespace {

using namespace wrenchd;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

TimePoint wall_now() {
  return std::chrono::steady_clock::now();
}
double milliseconds(Duration d) {
  return 1e3 * seconds(d);
}

constexpr double kPath_s = 0.9;

/// The hand moves down, presses 8 mm deep, and moves up again every 0.9 s. It rests above the table long
/// enough to arm.
SimulationSettings pressing_hand() {
  const Vector3d above(0.0, 0.0, 0.065), pressed(0.0, 0.0, 0.017);
  const Vector3d none = Vector3d::Zero();
  SimulationSettings hand;
  hand.hand_path = {{0.0, above, none},
                    {0.3, above, none},
                    {0.5, pressed, none},
                    {0.7, pressed, none},
                    {kPath_s, above, none}};
  hand.report_delay_s = hand.command_delay_s = 0.0;  // the socket has its own delay
  return hand;
}

/// The emulated device on its end of a socket. Its time continues while no daemon is connected.
class FarSide final : private ReportSink {
 public:
  explicit FarSide(const DeviceProfile& profile)
      : step_(from_seconds(1.0 / (16.0 * profile.report_rate_Hz))), device_(profile, pressing_hand()) {
    device_.advance_to(wall_now(), *this);
  }
  ~FarSide() { disconnect(); }
  FarSide(const FarSide&) = delete;
  FarSide& operator=(const FarSide&) = delete;

  /// Returns the daemon's end of a new socket.
  int plug() {
    disconnect();
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw std::system_error(errno, std::generic_category(), "socketpair");
    socket_ = ends[0];
    received_ = 0;
    pushed_ = false;
    plugged_ = device_.now();
    return ends[1];
  }

  /// Advances the device to the present time and receives the daemon's reports.
  void live() {
    for (const TimePoint now = wall_now(); device_.now() + step_ <= now;) {
      device_.advance_to(device_.now() + step_, *this);
      if (push_N() == 0.0) continue;
      pushed_ = pushed_ || device_.now() > plugged_ + kForgotten;
      last_push_ = device_.now();
      if (push_N() > strong_N_) strong_for_ += step_;
    }
    std::array<std::uint8_t, kMaxReportBytes> bytes;
    for (ssize_t n; (n = recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0;) {
      ++received_;
      if (!device_.take_command(device_.now(), std::span(bytes).first(static_cast<std::size_t>(n)))) continue;
      last_command_ = device_.now();
    }
  }

  void count_above(double strong_N) {
    strong_N_ = strong_N;
    strong_for_ = {};
  }
  double push_N() const { return device_.motor_wrench().force_N.norm(); }
  TimePoint now() const { return device_.now(); }
  TimePoint last_command() const { return last_command_; }
  TimePoint last_push() const { return last_push_; }
  /// Time with force above the threshold since count_above().
  Duration strong_for() const { return strong_for_; }
  long received() const { return received_; }  ///< number of commands since plug(), valid or not
  /// Returns true if there was force since plug() that is not a remainder of the previous daemon's command.
  bool pushed() const { return pushed_; }

 private:
  /// Drops the report if the socket is full, as a device does.
  void take_report(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    if (socket_ >= 0) send(socket_, report.data(), report.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  void disconnect() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

  static constexpr Duration kForgotten = std::chrono::milliseconds(50);

  Duration step_;
  SimulatedDevice device_;
  int socket_ = -1;
  TimePoint last_command_{}, last_push_{};
  double strong_N_ = 0.0;
  Duration strong_for_{};
  long received_ = 0;
  TimePoint plugged_{};
  bool pushed_ = false;
};

/// The real daemon as a child process. The destructor kills the daemon.
class Daemon {
 public:
  Daemon(const std::string& program, std::vector<std::string> arguments, int socket, const fs::path& log) {
    constexpr int kSocket = 3;
    arguments.insert(arguments.begin(), {program, "--link-fd", std::to_string(kSocket)});
    std::vector<char*> argv;
    for (std::string& word : arguments) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, socket, kSocket);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                     0600);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    const int error = posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    ::close(socket);
    if (error != 0) throw std::system_error(error, std::generic_category(), program);
  }
  ~Daemon() { end(); }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  void signal(int number) const { kill(pid_, number); }
  /// Halts only the servo thread. Returns false if the thread cannot be halted.
  bool hold_servo_thread() {
    held_ = thread_named("wrenchd-servo");
    if (held_ < 0 || ptrace(PTRACE_SEIZE, held_, nullptr, nullptr) != 0) return false;
    ptrace(PTRACE_INTERRUPT, held_, nullptr, nullptr);
    return waitpid(held_, nullptr, __WALL) == held_;
  }
  void let_servo_thread_go() const { ptrace(PTRACE_DETACH, held_, nullptr, nullptr); }
  void end() {
    if (over_) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    over_ = true;
  }
  /// Checks the child without waiting.
  void poll_exit() {
    int status = 0;
    if (over_ || waitpid(pid_, &status, WNOHANG | WUNTRACED) != pid_) return;
    stopped_ = WIFSTOPPED(status);
    over_ = !stopped_;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  bool over() const { return over_; }
  bool stopped() const { return stopped_; }
  int exit_code() const { return exit_code_; }  ///< -1 if a signal ended the daemon

 private:
  pid_t thread_named(const std::string& wanted) const {
    for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(pid_) + "/task")) {
      std::ifstream in(task.path() / "comm");
      std::string name;
      if (std::getline(in, name) && name == wanted) return std::stoi(task.path().filename());
    }
    return -1;
  }

  pid_t pid_ = -1, held_ = -1;
  bool over_ = false, stopped_ = false;
  int exit_code_ = -1;
};

struct Figures {
  double worst_ms = 0.0;         ///< from the last accepted command to the end of the force
  double after_signal_ms = 0.0;  ///< from the signal to the end of the force
  double stuck_ms = 0.0;         ///< from the halt of the servo thread to the end of the force
  double resume_ms = 0.0;        ///< duration of strong force after a stopped daemon continued
  long faults = 0;               ///< faults of daemons that were not killed and had to be restarted
  long violations = 0;
};

class Proof {
 public:
  Proof(std::string program, std::string profile, std::uint64_t seed)
      : program_(std::move(program)),
        profile_file_(std::move(profile)),
        profile_(load_profile_named(profile_file_, SearchPath({test::source_path("config")}))),
        random_(seed) {
    if (!(profile_.watchdog_s > 0.0))
      throw std::runtime_error("profile " + profile_.name +
                               " has no watchdog, and nothing to prove; take another");
    // All settings except the soft start are as shipped. A long soft start would only slow down the proof.
    config_ = files_.write("wrenchd.toml", "[device]\nfirst_test = false\n[limits]\nsoft_start_s = 0.25\n");
    bound_ = from_seconds(profile_.watchdog_s + 1.0 / profile_.report_rate_Hz);
  }

  void kill_once(long number) {
    number_ = number;
    signal_ = std::array{SIGKILL, SIGSEGV, SIGSTOP, kHold}[random_() % 4];
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      FarSide device(profile_);
      Daemon daemon = start(device, {"--arm"});
      if (press(device, daemon))
        return signal_ == kHold ? hold(device, daemon) : kill_pressing(device, daemon);
      if (daemon.over() && daemon.exit_code() != kExitFault)
        return violation("the daemon ended by itself with code " + std::to_string(daemon.exit_code()));
      count_fault();
    }
    load_.throw_if_busy();
    violation("no force on the hand in " + std::to_string(kAttempts) + " attempts");
  }

  const Figures& figures() const { return figures_; }
  Duration bound() const { return bound_; }

 private:
  static constexpr auto kLook = 100us;
  static constexpr double kPressing_N = 0.3;
  static constexpr int kAttempts = 10;
  /// A daemon that does not press within this time has raised a fault and waits for an acknowledgement.
  static constexpr auto kPatience = 6s;
  static constexpr int kExitFault = 3;  ///< exit code of the daemon after a fault
  static constexpr int kHold = 0;       ///< no signal; the tracer halts the servo thread

  void violation(const std::string& what) {
    ++figures_.violations;
    std::fprintf(stderr, "kill %ld (signal %d): %s\n", number_, signal_, what.c_str());
  }

  /// Counts a fault of a daemon that was not killed. Throws TooBusy if there are so many that the proof would
  /// not end in time, and the machine is busy.
  void count_fault() {
    ++figures_.faults;
    if (figures_.faults > kAttempts + 2 * number_) load_.throw_if_busy();
  }

  Daemon start(FarSide& device, std::vector<std::string> more) {
    more.insert(more.begin(), {"--config", config_, "--profile", profile_file_, "--realtime", "best_effort"});
    return {program_, std::move(more), device.plug(), files_.path() / "log"};
  }

  /// Returns false if the condition does not become true in time.
  template <class Condition>
  bool until(FarSide& device, Daemon& daemon, Duration most, Condition condition) {
    for (const TimePoint end = wall_now() + most; !condition();) {
      if (wall_now() >= end) return false;
      std::this_thread::sleep_for(kLook);
      device.live();
      daemon.poll_exit();
    }
    return true;
  }

  /// Advances the device to a random instant at which the motors press against the hand. Returns false if
  /// there was none. If this process was not scheduled in time, the daemon correctly treats the silence as a
  /// fault.
  bool press(FarSide& device, Daemon& daemon) {
    const auto pushes = [&] { return daemon.over() || device.push_N() > kPressing_N; };
    for (const TimePoint end = wall_now() + 20s; wall_now() < end && !daemon.over();) {
      if (!until(device, daemon, kPatience, pushes)) return false;
      const TimePoint then = wall_now() + std::chrono::microseconds(random_() % 250'000);
      until(device, daemon, 1s, [&] { return daemon.over() || wall_now() >= then; });
      if (!daemon.over() && pushes()) return true;
    }
    return false;
  }

  void kill_pressing(FarSide& device, Daemon& daemon) {
    const TimePoint signalled = device.now();
    daemon.signal(signal_);
    if (!until(device, daemon, 5s, [&] { return daemon.over() || daemon.stopped(); }))
      return violation("the daemon does not end");
    device.live();  // commands that the daemon sent before
    expect_silence(device, signalled);
    if (daemon.stopped()) goes_on(device, [&] { daemon.signal(SIGCONT); });
    daemon.end();
    restart(device);
  }

  void expect_silence(FarSide& device, TimePoint signalled) {
    const long received = device.received();
    for (const TimePoint end = device.now() + bound_ + 50ms; device.now() < end;) {
      std::this_thread::sleep_for(kLook);
      device.live();
    }
    if (device.received() != received) violation("commands arrive from a killed daemon");
    if (device.push_N() != 0.0) violation("the motors push on");
    const Duration held = device.last_push() - device.last_command();
    if (held > bound_)
      violation("force for " + std::to_string(milliseconds(held)) + " ms after the last command, more than " +
                std::to_string(milliseconds(bound_)));
    figures_.worst_ms = std::max(figures_.worst_ms, milliseconds(held));
    figures_.after_signal_ms =
        std::max(figures_.after_signal_ms, milliseconds(device.last_push() - signalled));
  }

  void hold(FarSide& device, Daemon& daemon) {
    if (!daemon.hold_servo_thread()) return violation("the servo thread cannot be held");
    device.live();
    const TimePoint held = device.now();
    const long received = device.received();
    for (const TimePoint end = device.now() + bound_ + 50ms; device.now() < end;) {
      std::this_thread::sleep_for(kLook);
      device.live();
    }
    if (device.received() == received) violation("the writer thread sends no zero wrench for a hung loop");
    if (device.push_N() != 0.0 || device.last_push() - held > bound_)
      violation("force for " + std::to_string(milliseconds(device.last_push() - held)) +
                " ms after the loop was stuck");
    figures_.stuck_ms = std::max(figures_.stuck_ms, milliseconds(device.last_push() - held));
    goes_on(device, [&] { daemon.let_servo_thread_go(); });
    daemon.end();
    restart(device);
  }

  /// The daemon may still send the command in progress. It must detect the interruption in the next tick.
  template <class Wake>
  void goes_on(FarSide& device, const Wake& wake) {
    device.count_above(0.1 * profile_.max_force_N);
    wake();
    for (const TimePoint end = device.now() + 100ms; device.now() < end;) {
      std::this_thread::sleep_for(kLook);
      device.live();
    }
    figures_.resume_ms = std::max(figures_.resume_ms, milliseconds(device.strong_for()));
    if (device.strong_for() > bound_) violation("a stopped daemon kicks when it goes on");
  }

  void restart(FarSide& device) {
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      Daemon daemon = start(device, {});
      const bool sends = until(device, daemon, 20s, [&] { return daemon.over() || device.received() > 0; });
      // The whole hand path: an armed daemon would see a calm hand within it and apply force.
      const TimePoint end = device.now() + from_seconds(kPath_s);
      until(device, daemon, 5s, [&] { return daemon.over() || device.now() > end; });
      const bool disarmed = !device.pushed();
      if (!disarmed) violation("the restarted daemon is not disarmed");
      if (daemon.over() && daemon.exit_code() == kExitFault) {
        count_fault();
        continue;
      }
      if (!sends || daemon.over())
        return violation("the restarted daemon sends no command, or ends without a signal");
      daemon.signal(SIGTERM);
      if (!until(device, daemon, 5s, [&] { return daemon.over(); }))
        return violation("the restarted daemon does not stop when asked");
      if (disarmed && device.pushed()) violation("the restarted daemon pushes as it ends");
      if (daemon.exit_code() ==
          kExitFault) {  // this process was not scheduled in time, so the device was silent
        count_fault();
        continue;
      }
      if (daemon.exit_code() != 0)
        violation("the restarted daemon ends with code " + std::to_string(daemon.exit_code()));
      return;
    }
    load_.throw_if_busy();
    violation("the restarted daemon raised a fault in " + std::to_string(kAttempts) + " attempts");
  }

  test::MachineLoad load_;
  test::TemporaryDirectory files_;
  std::string program_, profile_file_;
  DeviceProfile profile_;
  std::mt19937_64 random_;
  std::string config_;
  Duration bound_{};
  Figures figures_;
  long number_ = 0;
  int signal_ = 0;
};

/// Requests a real-time priority, because a device does not wait for other programs. If the system rejects
/// it, some attempts fail without an effect on the result.
void ask_for_realtime() {
  const sched_param priority{48};  // above the daemon's priority of 45
  sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority);
}

std::string beside_this_program(const char* name) {
  return (fs::read_symlink("/proc/self/exe").parent_path() / name).string();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "prove_kill: checks that the force ends in time when the daemon is killed, crashes, is stopped or "
      "hangs.\n"
      "This process emulates the device.");
  long kills = 10;
  std::uint64_t seed = 1;
  std::string profile = "loopback";
  std::string program = beside_this_program("wrenchd");
  app.add_option("--kills", kills, "number of kills")
      ->check(CLI::Range(1L, 100000000L))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the instants and signals")->capture_default_str();
  app.add_option("--profile", profile, "profile of the emulated device, whose reports contain complete poses")
      ->capture_default_str();
  app.add_option("--wrenchd", program, "path of the daemon")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const rlimit no_core{0, 0};  // the daemon crashes on purpose
  setrlimit(RLIMIT_CORE, &no_core);
  ask_for_realtime();
  try {
    const TimePoint start = wall_now();
    Proof proof(program, profile, seed);
    std::string too_busy;
    try {
      for (long n = 1; n <= kills; ++n) proof.kill_once(n);
    } catch (const test::TooBusy& busy) {
      too_busy = busy.what();
    }
    const Figures& f = proof.figures();
    std::printf(
        "kill kills %ld worst_ms %.3f bound_ms %.3f after_signal_ms %.3f stuck_ms %.3f resume_ms %.3f faults "
        "%ld "
        "violations %ld seed "
        "%llu seconds %.1f\n",
        kills, f.worst_ms, milliseconds(proof.bound()), f.after_signal_ms, f.stuck_ms, f.resume_ms, f.faults,
        f.violations, static_cast<unsigned long long>(seed), seconds(wall_now() - start));
    if (f.violations > 0) return 1;
    if (too_busy.empty()) return 0;
    std::printf("%s\n", too_busy.c_str());
    return test::kExitTooBusy;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "prove_kill: %s\n", error.what());
    return 1;
  }
}
