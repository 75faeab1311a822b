// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd::test {

/// How many of so many random cases to look at: a tenth under sanitizers, where all is ten times slower and
/// the cases looked at elsewhere prove no more.
constexpr int case_count(int cases) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return (cases + 9) / 10;
#else
  return cases;
#endif
}

}  // namespace wrenchd::test
