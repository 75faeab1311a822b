// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/firmware_reference.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "daemon/wall_clock.hpp"
#include "devices/conformance/conformance.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/firmware_in_hand.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tests/system/usbip_emulator.hpp"

namespace wrenchd::test {
namespace {

using namespace std::chrono_literals;

constexpr int kPriority = 60;  ///< as in kernel_test.cpp
constexpr int kPort = 0;

/// Checks the rules of the open report layout as the daemon does before the first arming.
std::vector<RuleResult> check_rules(Backend backend, FirmwareInHand& device) {
  UsbShape shape;
  shape.report_descriptor = reference_descriptor();
  const UsbIdentity identity;
  UsbipEmulator far(device, identity, shape, kPriority);
  far.plug(kPort);
  const UsbDevice listed = await_listed(identity);
  const DeviceProfile profile = reference_profile();
  const auto link = make_link(backend, listed, kPriority, link_settings(profile, 20ms));
  WallClock clock;
  set_own_priority(kPriority);
  const ConformanceUser nobody = {[](const std::string&) {}, [] { return false; }};
  const std::vector<RuleResult> results =
      check_conformance(profile, *link, &listed, clock, nobody, {.motion_time = 0s, .brief = true});
  set_own_priority(0);
  return results;
}

}  // namespace

void firmware_reference(Backend backend) {
  Row row(backend, "firmware of devices/firmware",
          "no rule of the open report layout is broken; with an inverted force force_direction is");
  SimulationSettings hand;
  hand.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0.1, 0.0, 0.2}}};
  hand.hand_repeats = false;
  const auto broken = [](const std::vector<RuleResult>& results) {
    std::string rules;
    for (const RuleResult& r : results)
      if (r.judgement == Judgement::fail) rules += (rules.empty() ? "" : ", ") + r.rule + ": " + r.seen;
    return rules;
  };
  FirmwareInHand good(reference_profile(), hand);
  const std::vector<RuleResult> results = check_rules(backend, good);
  const auto passed = std::count_if(results.begin(), results.end(),
                                    [](const RuleResult& r) { return r.judgement == Judgement::pass; });
  FirmwareMistakes inverted;
  inverted.wrench = [](wf_wrench& F) {
    for (auto& x : F.force_uN) x = -x;
  };
  FirmwareInHand bad(reference_profile(), hand, inverted);
  const std::string bad_rules = broken(check_rules(backend, bad));
  row.saw(format("%d rules pass; inverted: %s", static_cast<int>(passed), bad_rules.c_str()));
  if (!broken(results).empty()) row.saw(broken(results));
  CHECK_THAT(row, broken(results).empty());
  CHECK_THAT(row, passed >= 20);
  CHECK_THAT(row, bad_rules.find("force_direction: x") != std::string::npos);
  CHECK_THAT(row, good.max_force_N() > 0.0 && good.max_force_N() <= kMaxPulse_N + 1e-6);
}

}  // namespace wrenchd::test
