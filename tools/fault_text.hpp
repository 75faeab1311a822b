// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// The table of faults, for people: what each is, how it is found, what follows and when, why anybody looks
/// for it, what to do.
std::string fault_text();

/// One fault, by the name that stands in log and status. Throws std::runtime_error, with the names there are,
/// where there is none of that name.
std::string fault_text(const std::string& name);

/// The state machine, row by row.
std::string state_machine_text();

}  // namespace wrenchd
