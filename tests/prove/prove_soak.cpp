// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>

#include <CLI/CLI.hpp>
#include <sys/resource.h>

#include "daemon/option_checks.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/hand_path.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "tests/support/invariants.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/shipped_config.hpp"

// Runs the shipped scene for hours in virtual time, armed, while the hand presses and rocks repeatedly.
// Values must not drift, memory must not grow, and counter overflows must have no effect. The device's
// sequence (16 bits) wraps every 66 s, its clock (32 bits of microseconds) every 72 minutes. 1000 hours have
// 3.6 10^9 ticks.
//
// The test concerns the daemon, and three quarters of the cost of a tick with SimulatedDevice are its sixteen
// substeps. Therefore the handle has no mass here: the hand holds it by a spring; firmware and reports are
// those of SimulatedDevice.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Memory pages that the measurement itself may add. A sanitizer adds its own pages.
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

/// A handle on the spring of a hand that follows the shipped path. Sends one report per tick.
class HeldHandle final : public ReportLink {
 public:
  explicit HeldHandle(const RunConfig& plan)
      : layout_(plan.profile.pose_report),
        period_(from_seconds(1.0 / plan.profile.report_rate_Hz)),
        path_(plan.settings.simulation),
        firmware_(plan.profile, plan.settings.simulation, period_),
        stiffness_N_per_m_(plan.settings.simulation.hand_stiffness_N_per_m),
        stiffness_Nm_per_rad_(plan.settings.simulation.hand_stiffness_Nm_per_rad) {
    firmware_.initialize_encoders(path_.at(Duration{0}).X_BG);
  }

  void open() override {}
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    if (now < next_) return {LinkStatus::not_ready, 0, now};
    next_ = now + period_;
    firmware_.sample(held(now));
    return {LinkStatus::ok, encode(layout_, firmware_.make_report(now.time_since_epoch()), buffer), now};
  }
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override {
    firmware_.take_command(now, report);
    return LinkStatus::ok;
  }
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

 private:
  /// Returns the pose at which spring and motors balance. The wrench is low-pass filtered, because a pure
  /// spring would oscillate at half the loop rate.
  Pose held(TimePoint now) noexcept {
    const Wrench F = firmware_.motor_wrench(now);
    F_ = {F_.force_N + kSmoothing * (F.force_N - F_.force_N),
          F_.torque_Nm + kSmoothing * (F.torque_Nm - F_.torque_Nm)};
    const Pose X_BG = path_.at(now.time_since_epoch()).X_BG;
    return {rotation_from(F_.torque_Nm / stiffness_Nm_per_rad_) * X_BG.rotation,
            X_BG.translation_m + F_.force_N / stiffness_N_per_m_};
  }

  static constexpr double kSmoothing = 0.1;

  PoseReportLayout layout_;
  Duration period_;
  HandPath path_;
  SimulatedFirmware firmware_;
  double stiffness_N_per_m_, stiffness_Nm_per_rad_;
  Wrench F_;
  TimePoint next_{};
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs the shipped scene for hours in virtual time.");
  double minutes = 5.0;
  app.add_option("--minutes", minutes, "duration in virtual time [min]")->check(number_in_range(0.001, 1e6));
  std::uint64_t seed = 1;
  app.add_option("--seed", seed, "unused: all runs are equal");
  CLI11_PARSE(app, argc, argv);
  const RunConfig plan = shipped_config();
  VirtualClock clock;
  HeldHandle handle(plan);
  Runtime runtime(plan, handle, clock, ProxySearchMode::in_tick);
  runtime.open();
  ServoLoop& loop = runtime.loop();
  TickRecord last;
  const Duration period = from_seconds(1.0 / plan.settings.servo.rate_Hz);
  Invariants invariants({plan.profile.max_force_N, plan.profile.max_torque_Nm,
                         plan.settings.limits.force_slew_N_per_s, plan.settings.limits.torque_slew_Nm_per_s,
                         1.0 / plan.settings.servo.rate_Hz, 0.004});
  loop.requests().arm();
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
      clock.sleep_until(clock.now() + period);
      loop.tick(clock.now(), clock.now());
      loop.telemetry().latest_record().read(last);
      allocations += guard.allocations();
      locks += guard.locks();
    }
    if (const auto wrong = invariants.check(last); wrong && ++violations <= 10)
      std::printf("%s\n", wrong->c_str());
    if (last.faults != 0 && ++faults <= 10)
      std::printf("tick %llu faults %llx\n", static_cast<unsigned long long>(last.tick),
                  static_cast<unsigned long long>(last.faults));
    if (last.sequence < last_sequence) ++violations;
    last_sequence = last.sequence;
    most_N = std::max(most_N, Vector3d(last.F_out[0], last.F_out[1], last.F_out[2]).norm());
    if (i == minute) {
      pages_after_a_minute = resident_pages();
      page_faults = page_faults_so_far();
      first_lap_N = most_N;
    }
  }
  const long grown = ticks > minute ? resident_pages() - pages_after_a_minute : 0;
  page_faults = ticks > minute ? page_faults_so_far() - page_faults : 0;
  violations += static_cast<long>(allocations + locks);
  if (grown > kOwnPages || page_faults > kOwnPages || faults > 0 ||
      static_cast<State>(last.state) != State::active)
    ++violations;
  if (ticks > minute && std::abs(most_N - first_lap_N) > 1e-3 * first_lap_N)
    ++violations;  // the force drifts
  std::printf(
      "soak minutes %g ticks %llu allocations %llu locks %llu page_faults %ld pages_grown %ld faults %ld "
      "most_N %.6f injected_J %.3g violations %ld seed %llu\n",
      minutes, static_cast<unsigned long long>(ticks), static_cast<unsigned long long>(allocations),
      static_cast<unsigned long long>(locks), page_faults, grown, faults, most_N, last.injected_J, violations,
      static_cast<unsigned long long>(seed));
  return violations == 0 ? 0 : 1;
}
