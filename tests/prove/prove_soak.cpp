// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>

#include <CLI/CLI.hpp>
#include <sys/resource.h>

#include "devices/simulated_device.hpp"
#include "tests/support/invariants.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/shipped_plan.hpp"

// Hours of the shipped scene in virtual time, armed, the hand pressing and rocking again and again: nothing
// drifts, nothing grows, no counter's end is noticed. The device's sequence (16 bits) wraps every 66 seconds,
// its clock (32 bits of microseconds) every 72 minutes.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Of the program itself, when it looks at its own size. A sanitizer's are its own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr long kOwnPages = 1'000'000;
#else
constexpr long kOwnPages = 16;
#endif

long page_faults_so_far() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt + usage.ru_majflt;
}

long resident_pages() {
  std::ifstream statm("/proc/self/statm");
  long all = 0, resident = 0;
  statm >> all >> resident;
  return resident;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Hours of the shipped scene in virtual time.");
  double minutes = 5.0;
  app.add_option("--minutes", minutes, "of virtual time")->check(CLI::PositiveNumber);
  std::uint64_t seed = 1;
  app.add_option("--seed", seed, "unused: every run is the same");
  CLI11_PARSE(app, argc, argv);
  const Plan plan = shipped_plan();
  VirtualStation s(plan);
  Invariants invariants({plan.profile.max_force_N, plan.profile.max_torque_Nm,
                         plan.settings.limits.force_slew_N_per_s, plan.settings.limits.torque_slew_Nm_per_s,
                         1.0 / plan.settings.servo.rate_Hz, 0.004});
  s.station.loop().arm();
  const auto ticks = static_cast<std::uint64_t>(minutes * 60.0 * plan.settings.servo.rate_Hz);
  long violations = 0, faults = 0, pages_after_a_minute = 0;
  std::uint64_t last_sequence = 0;
  const auto minute = static_cast<std::uint64_t>(60.0 * plan.settings.servo.rate_Hz);
  std::uint64_t allocations = 0, locks = 0;
  long page_faults = 0;
  double most_N = 0.0, first_lap_N = 0.0;
  for (std::uint64_t i = 0; i < ticks; ++i) {
    {
      const RealtimeGuard guard;
      s.tick();
      allocations += guard.allocations();
      locks += guard.locks();
    }
    if (const auto wrong = invariants.check(s.last); wrong && ++violations <= 10)
      std::printf("%s\n", wrong->c_str());
    if (s.last.faults != 0 && ++faults <= 10)
      std::printf("tick %llu faults %llx\n", static_cast<unsigned long long>(s.last.tick),
                  static_cast<unsigned long long>(s.last.faults));
    if (s.last.sequence < last_sequence) ++violations;
    last_sequence = s.last.sequence;
    most_N = std::max(most_N, s.force_N());
    if (i == minute) {
      pages_after_a_minute = resident_pages();
      page_faults = page_faults_so_far();
      first_lap_N = most_N;
    }
  }
  const long grown = ticks > minute ? resident_pages() - pages_after_a_minute : 0;
  page_faults = ticks > minute ? page_faults_so_far() - page_faults : 0;
  violations += static_cast<long>(allocations + locks);
  if (grown > kOwnPages || page_faults > kOwnPages || faults > 0 || s.state() != State::active) ++violations;
  if (ticks > minute && std::abs(most_N - first_lap_N) > 1e-3 * first_lap_N)
    ++violations;  // a force that drifts
  std::printf(
      "soak minutes %g ticks %llu allocations %llu locks %llu page_faults %ld pages_grown %ld faults %ld "
      "most_N %.6f injected_J %.3g violations %ld seed %llu\n",
      minutes, static_cast<unsigned long long>(ticks), static_cast<unsigned long long>(allocations),
      static_cast<unsigned long long>(locks), page_faults, grown, faults, most_N, s.last.injected_J,
      violations, static_cast<unsigned long long>(seed));
  return violations == 0 ? 0 : 1;
}
