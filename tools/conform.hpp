// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>

#include "devices/conformance/conformance.hpp"

namespace wrenchd {

struct ConformOptions {
  std::string profile = "auto";
  std::string serial;
  std::string hidraw_node;  ///< "/dev/hidraw3"; empty: the connected device of the profile
  int link_fd = -1;         ///< socket to a device in another process; -1: none
  double motion_s = 20.0;   ///< longest time in which the user moves the handle
  bool pulses = true;
};

/// Returns one line per rule, and a line with the numbers of rules that passed, failed and could not be
/// judged. The line of a failed rule ends with the section of devices/README.md. Not RT-safe: allocates.
std::string conformance_text(std::span<const RuleResult> results);

/// `wrenchctl conform`: finds the device, checks the rules of the open report layout, and prints the result.
/// Returns true if no rule failed. Throws std::runtime_error as check_conformance(), and if no such device is
/// connected. Not RT-safe: takes some ten seconds.
bool run_conform(const ConformOptions& options);

}  // namespace wrenchd
