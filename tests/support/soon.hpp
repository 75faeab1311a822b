// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <thread>

namespace wrenchd::test {

/// Waits until the condition holds. Returns false if it does not hold within the limit.
template <class Condition>
bool soon(const Condition& condition, std::chrono::seconds limit = std::chrono::seconds(10)) {
  for (const auto end = std::chrono::steady_clock::now() + limit; std::chrono::steady_clock::now() < end;
       std::this_thread::sleep_for(std::chrono::milliseconds(5)))
    if (condition()) return true;
  return false;
}

}  // namespace wrenchd::test
