// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include <catch2/catch.hpp>

#include "tests/support/machine_load.hpp"

namespace wrenchd::test {

/// Text of the skip that the current test case requested; empty: none. tests/main.cpp prints it when the test
/// case ends.
inline std::string& skip_text() {
  static std::string text;
  return text;
}

}  // namespace wrenchd::test

/// A check that needs a rate in wall time. If the condition is false and the machine is too busy, requests a
/// skip and returns from the test case. Otherwise a false condition fails the test case. `load` is a
/// MachineLoad.
#define REQUIRE_RATE(load, ...)                           \
  do {                                                    \
    const bool rate_condition = (__VA_ARGS__);            \
    const wrenchd::test::MachineLoad& rate_load = (load); \
    if (!rate_condition && rate_load.busy()) {            \
      wrenchd::test::skip_text() = rate_load.busy_text(); \
      return;                                             \
    }                                                     \
    INFO(#__VA_ARGS__);                                   \
    REQUIRE(rate_condition);                              \
  } while (false)
