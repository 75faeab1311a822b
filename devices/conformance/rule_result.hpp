// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

namespace wrenchd {

enum class Judgement : std::uint8_t {
  pass,
  fail,
  not_judged,  ///< the rule could not be judged; `seen` states why
};

/// What a check of one rule has found.
struct RuleFinding {
  Judgement judgement = Judgement::not_judged;
  std::string seen;  ///< what was observed, with numbers
};

/// Result of one rule for a device.
struct RuleResult {
  std::string rule;  ///< such as "watchdog"
  Judgement judgement;
  std::string seen;     ///< what was observed, with numbers
  std::string section;  ///< section of devices/README.md that states the rule
};

/// Names of the axes x y z in the texts of findings.
inline constexpr const char* kAxisNames[] = {"x", "y", "z"};

/// Section of devices/README.md that states frames, units and signs of poses and wrenches.
inline constexpr const char* kUnitsSection = "Frames, units and signs";

}  // namespace wrenchd
