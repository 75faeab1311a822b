// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd::test {

/// Returns the number of random cases to run: a tenth under sanitizers, where each case is ten times slower.
constexpr int case_count(int cases) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return (cases + 9) / 10;
#else
  return cases;
#endif
}

}  // namespace wrenchd::test
