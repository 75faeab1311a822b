// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdio>
#include <string>

#include <catch2/catch.hpp>

#include "tests/support/machine_load.hpp"

namespace wrenchd::test {

/// Text of the skip that the current test case requested; empty: none.
inline std::string& skip_text() {
  static std::string text;
  return text;
}

/// Prints the text of a requested skip when the test case ends, because Catch2 2.13 has no skip. ctest then
/// reports the test as skipped (SKIP_REGULAR_EXPRESSION). A test case with a failed check stays a failure:
/// nothing is printed.
class SkipReporter : public Catch::TestEventListenerBase {
 public:
  using TestEventListenerBase::TestEventListenerBase;

  void testCaseStarting(const Catch::TestCaseInfo&) override { skip_text().clear(); }
  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    if (!skip_text().empty() && stats.totals.assertions.failed == 0) std::printf("%s\n", skip_text().c_str());
  }
};

}  // namespace wrenchd::test

/// A check that needs a rate in wall time. If the condition is false and the machine is too busy, requests a
/// skip and returns from the test case. Otherwise a false condition fails the test case. `load` is a
/// MachineLoad.
#define REQUIRE_RATE(load, ...)                        \
  do {                                                 \
    const bool rate_condition = (__VA_ARGS__);         \
    if (!rate_condition && (load).busy()) {            \
      wrenchd::test::skip_text() = (load).busy_text(); \
      return;                                          \
    }                                                  \
    INFO(#__VA_ARGS__);                                \
    REQUIRE(rate_condition);                           \
  } while (false)
