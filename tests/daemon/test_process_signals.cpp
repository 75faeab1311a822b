// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>
#include <cstdlib>
#include <optional>

#include <catch2/catch.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/process_signals.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd {
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

}  // namespace
}  // namespace wrenchd
