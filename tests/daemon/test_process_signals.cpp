// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/process_signals.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_process_signals {

namespace {

using namespace test;

/// Runs the check in a child process, so that the signal handlers of the test program stay unchanged.
template <class Check>
bool holds_in_child(const Check& check) {
  const pid_t child = fork();
  if (child == 0) _exit(check() ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST_CASE("SIGINT and SIGTERM request the end of the run", "[process_signals]") {
  for (const int signal : {SIGINT, SIGTERM})
    CHECK(holds_in_child([signal] {
      const ProcessSignals signals;
      const bool before = signals.stop_requested();
      std::raise(signal);
      return !before && signals.stop_requested();
    }));
}

TEST_CASE("each SIGHUP requests one reload", "[process_signals]") {
  CHECK(holds_in_child([] {
    const ProcessSignals signals;
    if (signals.take_reload_request()) return false;
    std::raise(SIGHUP);
    return signals.take_reload_request() && !signals.take_reload_request() && !signals.stop_requested();
  }));
}

TEST_CASE("SIGUSR1 stops the loop of the signal target, SIGUSR2 acknowledges", "[process_signals]") {
  CHECK(holds_in_child([] {
    const ProcessSignals signals;
    VirtualRuntime r;
    const SignalTarget target(r.runtime.loop());
    r.run(0.1);
    if (r.state() != State::disarmed) return false;
    std::raise(SIGUSR1);
    r.tick();
    if (r.state() != State::stopped) return false;
    std::raise(SIGUSR2);
    r.tick();
    return r.state() != State::stopped;
  }));
}

TEST_CASE("a signal reaches the loops of both hands, and a crash releases both", "[process_signals]") {
  CHECK(holds_in_child([] {
    const ProcessSignals signals;
    VirtualRuntime first, second;
    const SignalTarget target(first.runtime.loop());
    std::optional<SignalTarget> target_of_second(std::in_place, second.runtime.loop());
    const auto both = [&](State state) { return first.state() == state && second.state() == state; };
    const auto tick = [&] { first.tick(), second.tick(); };
    for (int i = 0; i < 100; ++i) tick();
    if (!both(State::disarmed)) return false;
    std::raise(SIGUSR1);
    tick();
    if (!both(State::stopped)) return false;
    target_of_second.reset();
    std::raise(SIGUSR2);
    tick();
    if (first.state() == State::stopped || second.state() != State::stopped) return false;
    target_of_second.emplace(second.runtime.loop());
    release_hand_before_exit();
    return first.runtime.loop().telemetry().state() == State::shutdown &&
           second.runtime.loop().telemetry().state() == State::shutdown;
  }));
}

TEST_CASE("a signal without a target, before and after one, has no effect", "[process_signals]") {
  CHECK(holds_in_child([] {
    const ProcessSignals signals;
    std::raise(SIGUSR1);
    std::optional<VirtualRuntime> r;
    r.emplace();
    std::optional<SignalTarget> target;
    target.emplace(r->runtime.loop());
    target.reset();
    std::raise(SIGUSR1);
    r->run(0.1);
    const bool unchanged = r->state() == State::disarmed;
    r.reset();
    std::raise(SIGUSR2);  // the loop does not exist any more
    return unchanged;
  }));
}

/// An armed loop in virtual time whose hand presses. The records are in memory that child processes share, so
/// that the test sees what the loop did in a process that a signal has ended.
struct ArmedRun {
  VirtualRuntime r;
  const SharedState& records = r.runtime.enable_shared_state();

  ArmedRun() {
    r.runtime.loop().requests().arm();
    for (int i = 0; i < 10000 && !(r.state() == State::active && r.force_N() > 0.1); ++i) r.tick();
    REQUIRE(r.state() == State::active);
    REQUIRE(r.force_N() > 0.1);
  }

  /// Runs `act` with the signal handlers in a child process, in which this thread is the servo thread. If the
  /// process survives, its loop runs on, and ends if a signal has requested it. Returns the wait status.
  template <class Act>
  int in_child(const Act& act) {
    const pid_t child = fork();
    if (child == 0) {
      for (int signal = 1; signal <= SIGSYS; ++signal) std::signal(signal, SIG_DFL);  // not those of Catch
      const ProcessSignals signals;
      const SignalTarget target(r.runtime.loop());
      const ServoThreadMark mark;
      act();
      for (int i = 0; i < 500 && r.state() != State::shutdown; ++i) {
        if (signals.stop_requested()) r.runtime.loop().requests().request(kQuit);
        r.tick();
      }
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return status;
  }
  StateRecord newest() const {
    StateRecord record;
    REQUIRE(records.read(records.written() - 1, record));
    return record;
  }
  bool released() const {
    const TickRecord tick = newest().tick;
    return static_cast<State>(tick.state) == State::shutdown && tick.released == 1 &&
           tick.motors_commanded == 0 && tick.F_out == TickRecord::Numbers6{};
  }
};

TEST_CASE("every signal leaves the loop running, or releases the hand before the process ends",
          "[process_signals]") {
  ArmedRun run;
  int running = 0;
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    if (signal == SIGKILL || signal == SIGSTOP) continue;  // no process can handle them
    if (signal > SIGSYS && signal < SIGRTMIN) continue;    // the C library uses them itself
    INFO("signal " << signal << " (" << strsignal(signal) << ")");
    const std::uint64_t before = run.records.written();
    const int status = run.in_child([signal] { std::raise(signal); });
    REQUIRE(run.records.written() > before);
    const auto state = static_cast<State>(run.newest().tick.state);
    const bool survived = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    if (survived && (state == State::active || state == State::stopped)) {
      ++running;
    } else {
      CHECK((survived || (WIFSIGNALED(status) && WTERMSIG(status) == signal)));
      CHECK(run.released());
    }
  }
  CHECK(running >= 8);
}

TEST_CASE("a signal whose default ends the process never does so unless it reports a crash",
          "[process_signals]") {
  ArmedRun run;
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTSTP, SIGTTIN, SIGTTOU, SIGHUP}) {
    INFO("signal " << signal);
    const int status = run.in_child([signal] { std::raise(signal); });
    CHECK((WIFEXITED(status) && WEXITSTATUS(status) == 0));
    CHECK(static_cast<State>(run.newest().tick.state) == State::active);
  }
}

TEST_CASE("a crash of another thread lets the servo thread release the hand", "[process_signals]") {
  ArmedRun run;
  const std::uint64_t before = run.records.written();
  const int status = run.in_child([&run] {
    std::thread([] { std::raise(SIGSEGV); }).detach();
    for (int i = 0; i < 10000; ++i) {  // the process ends while the loop ticks
      run.r.tick();
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  });
  CHECK((WIFSIGNALED(status) && WTERMSIG(status) == SIGSEGV));
  // The loop ticks on, and never takes the device for a new one.
  bool released = false;
  StateRecord record;
  for (std::uint64_t i = before; i < run.records.written(); ++i) {
    REQUIRE(run.records.read(i, record));
    released = released || record.tick.released == 1;
    if (!released) continue;
    REQUIRE(static_cast<State>(record.tick.state) == State::shutdown);
    REQUIRE(record.tick.released == 1);
    REQUIRE(record.tick.F_out == TickRecord::Numbers6{});
  }
  CHECK(released);
}

TEST_CASE("an exception that nobody handles releases the hand before the process aborts",
          "[process_signals]") {
  ArmedRun run;
  const auto fail = [](const char* text) { throw std::runtime_error(text); };
  const int status = run.in_child([&fail] { [&fail]() noexcept { fail("an exception of the test"); }(); });
  CHECK((WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT));
  CHECK(run.released());
}

}  // namespace
}  // namespace wrenchd::test_process_signals
