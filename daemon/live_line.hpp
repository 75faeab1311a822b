// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// Which wrench the live line shows.
enum class ShownWrench : std::uint8_t {
  sent,     ///< sent to the device: about the point and in the axes of its profile
  on_tool,  ///< on the tool, for a device without motors: about the origin of T, in the axes of W
};

/// Returns one line for a person: device time, state, pose of the tool, contacts, force, torque, and
/// p50/p99.9/max of the tick time. Not RT-safe: allocates.
std::string live_line(const TickRecord& record, const LoopTiming& timing,
                      ShownWrench shown = ShownWrench::sent);

/// Totals of a run. The live view samples the loop every 100 ms.
struct RunTotals {
  ShownWrench shown = ShownWrench::sent;
  double seconds = 0.0;
  std::uint64_t ticks = 0;
  std::uint64_t samples_in_contact = 0;  ///< samples with at least one contact
  std::uint64_t samples = 0;
  double max_force_N = 0.0;    ///< largest force of all samples
  double max_torque_Nm = 0.0;  ///< largest torque of all samples
};

/// Adds a tick record to the totals. Not RT-safe.
void add_sample(RunTotals& totals, const TickRecord& record);

/// Returns several lines for the end of a run: rate, contact, times of each stage, overruns. Not RT-safe:
/// allocates.
std::string summary(const RunTotals& totals, const LoopTiming& timing);

}  // namespace wrenchd
