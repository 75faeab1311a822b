// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/first_test.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <string_view>

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include "core/fault.hpp"
#include "daemon/wait_text.hpp"
#include "devices/conformance/conformance.hpp"
#include "devices/conformance/device_session.hpp"
#include "devices/conformance/direction_check.hpp"
#include "devices/conformance/direction_pulses.hpp"
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

bool needs_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested) {
  return config.settings.device.first_test && driven_dofs(config.profile) != kNoDof &&
         !tested.contains(tested_device(config, device));
}

void announce(const DeviceProfile& profile, const ReportWaiting& waiting) {
  const DofMask driven = driven_dofs(profile);
  std::string pulses;
  if ((driven & kLinearDofs) != 0) pulses = fmt::format("{:.2f} N", pulse_force_N(profile));
  if ((driven & kAngularDofs) != 0)
    pulses += fmt::format("{}{:.3f} N.m", pulses.empty() ? "" : " and ", pulse_torque_Nm(profile));
  spdlog::info(
      "the device is tested before it is armed for the first time. Hold the handle loosely, or leave it: "
      "pulses of at most {} follow",
      pulses);
  waiting("the device is tested before it is armed for the first time");
}

/// Result of up to two tests of a device.
struct TestResult {
  Results last;    ///< results of the second test, or of the first one if no rule failed in it
  Results broken;  ///< rules that failed in the first test and did not pass in the second
};

TestResult test_twice(const std::function<Results()>& test) {
  TestResult result;
  result.last = test();
  result.broken = failed_rules(result.last);
  if (result.broken.empty()) return result;
  result.last = test();
  std::erase_if(result.broken, [&](const RuleResult& rule) { return passed(result.last, rule.rule); });
  return result;
}

/// Logs the result, and stores that the device passed. Returns why the device must not be armed; `remedy`
/// ends the sentence.
std::string conclude(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested,
                     const TestResult& result, const std::string& remedy) {
  for (const RuleResult& rule : result.broken)
    spdlog::error("test of the device: {}: {} (breaks devices/README.md, {})", rule.rule, rule.seen,
                  rule.section);
  log_not_judged(result.last);
  if (!result.broken.empty()) {
    const RuleResult& first = result.broken.front();
    return fmt::format("it failed the test before its first arming: {}, {}; {}", first.rule, first.seen,
                       remedy);
  }
  const DofMask driven = driven_dofs(config.profile);
  if ((driven & kLinearDofs) != 0 && !passed(result.last, "force_direction")) return {};
  if ((driven & kAngularDofs) != 0 && !passed(result.last, "torque_direction")) return {};
  const TestedDevice passed_device = tested_device(config, device);
  if (passed_device.serial.empty()) return {};
  try {
    tested.add(passed_device);
    spdlog::info("the device passed its test; wrenchd stores this by its serial number");
  } catch (const std::exception& error) {
    spdlog::warn("the device passed its test, and will be tested again at the next start: {}", error.what());
  }
  return {};
}

std::string did_not_end(const std::exception& error) {
  return std::string("the test before its first arming did not end: ") + error.what();
}

/// Waits until the device sends valid poses, without limit while a person must home it. Returns why it does
/// not; "" if it does. Throws DeviceDisconnected and SessionCancelled.
std::string wait_until_valid(ProfileDevice& device, Clock& clock, const StopCondition& stop,
                             const ReportWaiting& waiting) {
  constexpr Duration kPeriod = std::chrono::milliseconds(1), kTimeout = std::chrono::seconds(3);
  TimePoint timeout = clock.now() + kTimeout;
  bool asked_to_home = false;
  Fault fault = Fault::none;
  while (clock.now() < timeout) {
    if (stop()) throw SessionCancelled();
    clock.sleep_until(clock.now() + kPeriod);
    const DeviceSample sample = device.read_newest(clock.now());
    if (sample.fault == Fault::device_lost) throw DeviceDisconnected();
    device.write(clock.now(), {}, false);
    if (sample.fault != Fault::none) fault = sample.fault;
    if (sample.fresh && sample.homed && device.trusted() && sample.fault == Fault::none) return {};
    if (sample.homed) continue;
    timeout = clock.now() + kTimeout;
    if (asked_to_home) continue;
    const std::string text = wait_text({.kind = WaitReason::Kind::not_homed});
    spdlog::info("{}", text);
    waiting(text);
    asked_to_home = true;
  }
  const std::string seen = fault == Fault::none ? "" : " (" + std::string(fault_row(fault).name) + ")";
  return "it sends no valid pose" + seen +
         ", so it could not be tested; correct its profile, then plug it in again";
}

}  // namespace

bool needs_first_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested) {
  return has_open_layout(config.profile) && needs_test(config, device, tested);
}

bool needs_direction_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested) {
  return !has_open_layout(config.profile) && needs_test(config, device, tested);
}

std::optional<std::string> run_first_test(const RunConfig& config, ReportLink& link, const UsbDevice* device,
                                          Clock& clock, const StopCondition& stop,
                                          const ReportWaiting& waiting, const TestedDevices& tested) {
  announce(config.profile, waiting);
  const ConformanceUser user = {[](const std::string&) {}, stop};
  const ConformanceOptions options = {Duration{0}, true, true};
  try {
    const TestResult result =
        test_twice([&] { return check_conformance(config.profile, link, device, clock, user, options); });
    return conclude(config, device, tested, result,
                    "correct its firmware or its profile: wrenchctl conform prints the result of every rule");
  } catch (const SessionCancelled&) {
    return {};
  } catch (const std::runtime_error& error) {
    return did_not_end(error);
  }
}

std::optional<std::string> run_direction_test(const RunConfig& config, ProfileDevice& device,
                                              const UsbDevice* usb_device, Clock& clock,
                                              const StopCondition& stop, const ReportWaiting& waiting,
                                              const TestedDevices& tested) {
  try {
    if (std::string obstacle = wait_until_valid(device, clock, stop, waiting); !obstacle.empty())
      return obstacle;
    announce(config.profile, waiting);
    const TestResult result = test_twice([&] { return check_directions(device, clock, stop); });
    return conclude(
        config, usb_device, tested, result,
        "correct its profile, the signs and the order of encoders and motors in [kinematics] and of the "
        "fields of [wrench_report], or its wiring");
  } catch (const DeviceDisconnected&) {
    return {};
  } catch (const SessionCancelled&) {
    return {};
  } catch (const std::runtime_error& error) {
    return did_not_end(error);
  }
}

}  // namespace wrenchd
