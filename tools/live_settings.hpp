// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "daemon/control/json_rpc.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd {

// wrenchctl set: shows and changes the settings of a running daemon that rendering.set accepts.

/// A setting with its new value, as the user typed them.
struct Assignment {
  std::string name;
  std::string value;
  std::string unit;  ///< empty: the unit of the setting
};

/// Splits the words NAME=VALUE, NAME VALUE and NAME VALUE UNIT. A word without a value is an assignment with
/// an empty value. settings: "settings" of the result of rendering.get. Throws std::runtime_error.
std::vector<Assignment> assignments_of(const std::vector<std::string>& words, const Json& settings);

/// Returns the rows of the setting that a user means: all components of a gain, else one row. The section and
/// the unit may be left out; "stiffness" and "rendering.stiffness" mean "wrench.stiffness". Throws
/// std::runtime_error with the nearest name if there is none, or with all names if there are several.
std::vector<Json> find_settings(const std::string& name, const Json& settings);

/// Returns the parameters of rendering.set for all assignments. A gain is stated completely: the component
/// that is not assigned keeps its value. Throws std::runtime_error that names the setting and the cure.
Json rendering_request(const std::vector<Assignment>& assignments, const Json& settings);

/// Returns the rows as a table: name, value, unit, what is accepted, and why a value is not used.
std::string settings_text(const std::vector<Json>& rows);

/// Returns the changes line by line, and the command that undoes them. changed: of the result of
/// rendering.set.
std::string changes_text(const Json& changed);

/// Returns what the stability bound leaves of the stiffness; empty if it neither scales it now nor did
/// before.
std::string scale_text(double scale_before, double scale_now, const Json& settings);

/// Shows all settings, those that are named without a value, or changes those with a value: all of them, or
/// none if one is rejected. Not RT-safe: waits for the daemon.
void run_set(const std::vector<std::string>& words, const ControlOptions& options);

}  // namespace wrenchd
