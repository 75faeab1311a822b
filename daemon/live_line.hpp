// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/loop_totals.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// Which wrench the live line shows.
enum class ShownWrench : std::uint8_t {
  sent,     ///< sent to the device: about the point and in the axes of its profile
  on_tool,  ///< on the tool, for a device without motors: about the origin of T, in the axes of W
};

/// Returns one line for a person: device time, state, pose of the tool, contacts, force, torque, and
/// p50/p99.9/max of the tick time. no_force: why there is no force; it takes the place of force and torque
/// unless it is empty. Not RT-safe: allocates.
std::string live_line(const TickRecord& record, const LoopTiming& timing,
                      ShownWrench shown = ShownWrench::sent, const std::string& no_force = {});

/// Returns several lines for the end of a run: ticks, rate, contact, largest wrench, times of each stage,
/// overruns. seconds: duration of the run. Not RT-safe: allocates.
std::string summary(const LoopTotals& totals, const LoopTiming& timing, double seconds,
                    ShownWrench shown = ShownWrench::sent);

}  // namespace wrenchd
