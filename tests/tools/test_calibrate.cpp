// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "tests/support/polhem_in_hand.hpp"
#include "tests/support/run_program.hpp"
#include "tools/calibrate.hpp"

namespace wrenchd::test_calibrate {

namespace {

using namespace test;
using Catch::Contains;

/// A simulated operator who follows the instructions and knows only their text.
struct ObedientOperator {
  PolhemInHand polhem;
  std::vector<std::string> instructions;
  int ms_left = 60000;
  bool unplugs = false;

  OperatorInterface person() {
    return {[this](const std::string& instruction) {
              instructions.push_back(instruction);
              const std::array<std::string, 6> axis_phrases = {
                  "away from you.",       "straight to the left",   "straight up",
                  "top of the handle to", "top of the handle away", "Turn"};
              HomingState requested;
              requested.step = instruction.find("into its reference pose") != std::string::npos
                                   ? HomingStep::reference
                                   : HomingStep::holding_still;
              for (std::size_t axis = 0; axis < 6; ++axis) {
                if (instruction.find(axis_phrases[axis]) == std::string::npos) continue;
                requested.step = HomingStep::moving;
                requested.axis = axis;
              }
              polhem.follow_instructions(requested);
            },
            [this] { return (polhem.X_BH.translation_m - polhem.target.translation_m).norm() < 1e-9; },
            [this] {
              polhem.step();
              if (unplugs && instructions.size() == 3) polhem.unplug();
              return --ms_left <= 0;
            }};
  }
  Calibration calibrated() {
    polhem.device.open();
    return calibrate(polhem.device, polhem.profile, "A1", polhem.clock, person());
  }
};

}  // namespace

TEST_CASE("a calibration instructs the operator and returns the offsets", "[calibrate]") {
  ObedientOperator bench;
  const Calibration found = bench.calibrated();
  CHECK(found.profile == "polhem");
  CHECK(found.serial == "A1");
  REQUIRE(found.offsets.size() == 6);
  // Count offsets of the joints at power-on.
  const Kinematics& k = bench.polhem.profile.kinematics;
  for (std::size_t i = 0; i < 6; ++i) {
    const double missing = bench.polhem.at_power_on[k.report_index[i]] * k.rad_per_count[i];
    CHECK(found.offsets[i].offset == Approx(-missing).margin(0.01));
  }
  CHECK(bench.instructions.back() == "Homed: the device may be armed.");
}

TEST_CASE("a failed calibration states the reason and returns nothing", "[calibrate]") {
  ObedientOperator bench;
  bench.polhem.swapped_axis = 1;
  CHECK_THROWS_WITH(bench.calibrated(), Contains("Homing failed. That moved z, not y.") &&
                                            Contains("check their order in the profile"));
}

TEST_CASE("a calibration ends if the operator cancels or the device is disconnected", "[calibrate]") {
  ObedientOperator cancelling;
  cancelling.ms_left = 2000;
  CHECK_THROWS_WITH(cancelling.calibrated(), Contains("no calibration was stored"));
  ObedientOperator unplugging;
  unplugging.unplugs = true;
  CHECK_THROWS_WITH(unplugging.calibrated(),
                    Contains("the device was disconnected; connect it and start again"));
}

TEST_CASE("wrenchctl calibrate rejects devices that it cannot calibrate") {
  struct {
    std::vector<std::string> arguments;
    std::string expected;
  } const table[] = {
      {{"calibrate", "gone"}, "gone.toml: no such file"},
      {{"calibrate", "loopback"}, "profile loopback: it is for the simulated device"},
      {{"calibrate", "polhem"}, "no such device is connected; wrenchctl devices lists the connected devices"},
      {{"calibrate", ""}, "must not be empty; name a profile, or leave it out"},
      {{"calibrate", "polhem", "--serial", ""}, "--serial: must not be empty; give the serial number"},
  };
  for (const auto& [arguments, expected] : table) {
    const ProgramResult result = run_program("wrenchctl", arguments);
    INFO(expected << "\ngot " << result.err);
    CHECK(result.exit_code != 0);
    CHECK(result.err.find(expected) != std::string::npos);
  }
}

}  // namespace wrenchd::test_calibrate
