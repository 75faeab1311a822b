// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/servo/stability_analysis.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_stability_analysis {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

/// Returns the measurement of 1 s of ticks at 1 kHz. age: age of each sample. Commands are acknowledged after
/// ticks_to_acknowledge.
LoopMeasurement measured(Duration age, std::uint64_t ticks_to_acknowledge) {
  LoopMeasurement loop(0.002);
  for (std::uint64_t i = 1; i < 1000; ++i) {
    const TimePoint now = TimePoint{} + std::chrono::milliseconds(i);
    loop.tick({now, now - age, 1e-3 * static_cast<double>(i), i, true, true,
               i > ticks_to_acknowledge ? i - ticks_to_acknowledge : 0, i});
  }
  return loop;
}

StabilityAnalysis stability_of(const RunConfig& config) {
  const Scene scene(config.scene);
  return StabilityAnalysis(config.settings, config.profile, scene.tool().solid.inertia, scene.tool().X_MT());
}

}  // namespace

TEST_CASE("the shipped stiffness stays, and ten times that stiffness is scaled", "[stability]") {
  RunConfig config = shipped_config();
  config.settings.wrench.law = SpringLaw::pid;
  const LoopMeasurement loop = measured(500us, 1);
  const StiffnessScale shipped = stability_of(config).max_stable_scale(loop);
  CHECK(shipped.bound_known);
  CHECK(shipped.spring == 1.0);
  CHECK(shipped.damper == 1.0);
  config.settings.wrench.gains.stiffness *= 10.0;
  const StiffnessScale stiff = stability_of(config).max_stable_scale(loop);
  CHECK(stiff.spring < 0.5);
  // METHOD (78) with the measured delay.
  const double b = config.profile.damping_N_s_per_m;
  CHECK(stiff.spring * 6000.0 * (0.5 * loop.longest_period_s() + loop.delay_s()) +
            stiff.damper * config.settings.wrench.gains.damping(0, 0) <=
        b * (1.0 + 1e-9));
  CHECK(stability_of(config).max_stable_scale(measured(2500us, 3)).spring < stiff.spring);
}

TEST_CASE("without stated damping only the maximum stiffness of the profile applies", "[stability]") {
  RunConfig config = shipped_config();
  config.settings.wrench.law = SpringLaw::pid;
  config.settings.wrench.gains.stiffness *= 10.0;
  config.profile.damping_N_s_per_m = DeviceProfile::kNotStated;
  const StiffnessScale unknown = stability_of(config).max_stable_scale(measured(500us, 1));
  CHECK_FALSE(unknown.bound_known);
  CHECK(unknown.spring == 1.0);
  config.profile.max_stiffness_N_per_m = 1500.0;
  CHECK(stability_of(config).max_stable_scale(measured(500us, 1)).spring == Approx(0.25));
}

TEST_CASE("the encoder step of a profile bounds the stiffness", "[stability]") {
  RunConfig config = shipped_config();
  config.profile.encoder_step_m = 200e-6;
  const StiffnessScale coarse = stability_of(config).max_stable_scale(measured(500us, 1));
  CHECK(coarse.bound_known);
  CHECK(coarse.spring * 600.0 <= 51.0);
  config.profile.encoder_step_m = DeviceProfile::kNotStated;
  CHECK(stability_of(config).max_stable_scale(measured(500us, 1)).spring == 1.0);
}

TEST_CASE("the bound of the energy law uses the stiffness of that law", "[stability]") {
  RunConfig config = shipped_config();
  config.settings.wrench.law = SpringLaw::energy;
  const LoopMeasurement loop = measured(500us, 1);
  CHECK(stability_of(config).max_stable_scale(loop).spring == 1.0);
  config.settings.wrench.energy_stiffness_per_s2 *= 20.0;
  CHECK(stability_of(config).max_stable_scale(loop).spring < 0.3);
}

TEST_CASE("wrenchd scales a stiffness above the bound, and logs it", "[stability]") {
  const TemporaryDirectory dir;
  const std::string config =
      dir.write(
             "stiff.toml",
             "[wrench]\nlaw = \"pid\"\nstiffness = { linear_N_per_m = 9000.0, angular_Nm_per_rad = 20.0 }\n")
          .string();
  const ProgramResult result =
      run_program("wrenchd", {"--config", config, "--virtual-time", "--seconds", "4", "--arm", "--live"});
  INFO(result.err);
  CHECK(result.exit_code == 0);
  CHECK(result.err.find("scales the stiffness to") != std::string::npos);
  CHECK(result.out.find("in contact in 0 ticks") == std::string::npos);
}

}  // namespace wrenchd::test_stability_analysis
