// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// Returns the fault table for the user: description, detection, reaction and its timing, reason for the
/// check, remedy. Not RT-safe: allocates.
std::string fault_text();

/// Returns the row of one fault, by its name in log and status. Throws std::runtime_error with all names if
/// the name is unknown. Not RT-safe: allocates.
std::string fault_text(const std::string& name);

/// Returns the state machine, one row per transition. Not RT-safe: allocates.
std::string state_machine_text();

}  // namespace wrenchd
