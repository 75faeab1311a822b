// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>

#include <catch2/catch.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "tools/end_signals.hpp"

namespace wrenchd::test_end_signals {

namespace {

/// Sends a signal to a child process. Returns the child's end: its exit code is 1 if end_requested() was true
/// before the signal, 2 if it was false after it, else 0.
int end_of_child(int signal, bool catches) {
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    if (catches) catch_end_signals();
    if (end_requested()) _exit(1);
    raise(signal);
    _exit(end_requested() ? 0 : 2);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return status;
}

}  // namespace

TEST_CASE("a signal that would end a command requests its end instead", "[end_signals]") {
  const int signal = GENERATE(SIGINT, SIGTERM, SIGHUP, SIGQUIT);
  const int caught = end_of_child(signal, true);
  CHECK(WIFEXITED(caught));
  CHECK(WEXITSTATUS(caught) == 0);
}

TEST_CASE("without catch_end_signals() a signal ends the program", "[end_signals]") {
  const int ended = end_of_child(SIGTERM, false);
  CHECK(WIFSIGNALED(ended));
  CHECK(WTERMSIG(ended) == SIGTERM);
}

}  // namespace wrenchd::test_end_signals
