// SPDX-License-Identifier: GPL-3.0-or-later
// The limiter against its oracle, for as long as one likes:
//
//   prove_limits --cases 100000000 --seed 1
//
// prints one line, `limits cases N violations V seed S seconds T`, and the first few cases that break an
// invariant.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "tests/support/limit_cases.hpp"

int main(int argc, char** argv) {
  std::uint64_t cases = 1'000'000, seed = 1;
  CLI::App app("Checks the limiter against its oracle");
  app.add_option("--cases", cases, "number of cases");
  app.add_option("--seed", seed, "seed of the cases");
  CLI11_PARSE(app, argc, argv);

  constexpr std::uint64_t kShown = 5;
  const auto start = std::chrono::steady_clock::now();
  std::uint64_t violations = 0;
  wrenchd::test::LimitCases stream(seed);
  for (std::uint64_t i = 0; i < cases; ++i) {
    const std::string broken = stream.next();
    if (!broken.empty() && ++violations <= kShown)
      std::fprintf(stderr, "broken: %s\n%s\n", broken.c_str(), stream.describe().c_str());
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  std::printf("limits cases %llu violations %llu seed %llu seconds %.1f\n",
              static_cast<unsigned long long>(cases), static_cast<unsigned long long>(violations),
              static_cast<unsigned long long>(seed), took.count());
  return violations == 0 ? 0 : 1;
}
