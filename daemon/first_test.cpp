// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/first_test.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>

#include <spdlog/spdlog.h>

#include "devices/conformance/conformance.hpp"
#include "devices/layout_check.hpp"

namespace wrenchd {
namespace {

/// Rules that concern how a device is found. wrenchd has found it.
constexpr std::array<std::string_view, 3> kIdentityRules = {"report_descriptor", "usb_id", "serial_number"};

using Results = std::vector<RuleResult>;

TestedDevice tested_device(const RunConfig& config, const UsbDevice* device) {
  TestedDevice made{config.profile.name, device == nullptr ? "" : device->serial, {}};
  for (const ConfigText& part : config.profile_texts) made.profile_text += part.text;
  return made;
}

const RuleResult* find_rule(const Results& results, const std::string& rule) {
  const auto found =
      std::find_if(results.begin(), results.end(), [&](const RuleResult& r) { return r.rule == rule; });
  return found == results.end() ? nullptr : &*found;
}

/// Returns the failed rules that concern how the device behaves.
Results failed_rules(const Results& results) {
  Results failed;
  std::copy_if(results.begin(), results.end(), std::back_inserter(failed), [](const RuleResult& result) {
    return result.judgement == Judgement::fail &&
           std::find(kIdentityRules.begin(), kIdentityRules.end(), result.rule) == kIdentityRules.end();
  });
  return failed;
}

bool passed(const Results& results, const std::string& rule) {
  const RuleResult* result = find_rule(results, rule);
  return result != nullptr && result->judgement == Judgement::pass;
}

void log_not_judged(const Results& results) {
  for (const RuleResult& result : results)
    if (result.judgement == Judgement::not_judged)
      spdlog::info("test of the device: {} was not judged: {}", result.rule, result.seen);
}

}  // namespace

bool needs_first_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested) {
  return config.settings.device.first_test && driven_dofs(config.profile) != kNoDof &&
         has_open_layout(config.profile) && !tested.contains(tested_device(config, device));
}

std::string run_first_test(const RunConfig& config, ReportLink& link, const UsbDevice* device, Clock& clock,
                           const StopCondition& stop, const ReportWaiting& waiting,
                           const TestedDevices& tested) {
  spdlog::info(
      "the device is tested before it is armed for the first time. Hold the handle loosely, or leave it: "
      "pulses of at most {} N and {} N.m follow",
      kMaxPulse_N, kMaxPulse_Nm);
  waiting("the device is tested before it is armed for the first time");
  const ConformanceUser user = {[](const std::string&) {}, stop};
  const ConformanceOptions options = {Duration{0}, true, true};
  Results results, broken;
  try {
    results = check_conformance(config.profile, link, device, clock, user, options);
    broken = failed_rules(results);
    if (!broken.empty()) {
      results = check_conformance(config.profile, link, device, clock, user, options);
      std::erase_if(broken, [&](const RuleResult& rule) { return passed(results, rule.rule); });
    }
  } catch (const std::runtime_error& error) {
    return std::string("the test before its first arming did not end: ") + error.what();
  }
  for (const RuleResult& rule : broken)
    spdlog::error("test of the device: {}: {} (breaks devices/README.md, {})", rule.rule, rule.seen,
                  rule.section);
  log_not_judged(results);
  if (!broken.empty())
    return "it failed the test before its first arming: " + broken.front().rule + ", " + broken.front().seen +
           "; correct its firmware or its profile: wrenchctl conform prints the result of every rule";
  const DofMask driven = driven_dofs(config.profile);
  if ((driven & kLinearDofs) != 0 && !passed(results, "force_direction")) return {};
  if ((driven & kAngularDofs) != 0 && !passed(results, "torque_direction")) return {};
  const TestedDevice passed_device = tested_device(config, device);
  if (passed_device.serial.empty()) return {};
  try {
    tested.add(passed_device);
    spdlog::info("the device passed its test; wrenchd remembers it by its serial number");
  } catch (const std::exception& error) {
    spdlog::warn("the device passed its test, and will be tested again at the next start: {}", error.what());
  }
  return {};
}

}  // namespace wrenchd
