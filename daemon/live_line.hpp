// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// What the hand would feel of a device without motors is what the tool feels: about the origin of its body
/// frame, in the axes of the world. With motors: what is sent, as the device wants it.
enum class ShownWrench : std::uint8_t { sent, on_tool };

/// One line for a person: device time, state, pose of the tool, contacts, force, torque, tick p50/p99.9/max.
std::string live_line(const TickRecord& record, const LoopTiming& timing,
                      ShownWrench shown = ShownWrench::sent);

/// What a run came to.
struct RunTotals {
  ShownWrench shown = ShownWrench::sent;
  double seconds = 0.0;
  std::uint64_t ticks = 0;
  std::uint64_t samples_in_contact = 0;  ///< of those that were looked at for the live line
  std::uint64_t samples = 0;
  double max_force_N = 0.0;  ///< seen at the looks
  double max_torque_Nm = 0.0;
};

/// Adds a look at the loop to the totals.
void add_sample(RunTotals& totals, const TickRecord& record);

/// Several lines at the end of a run: rate, contact, times of each stage, overruns.
std::string summary(const RunTotals& totals, const LoopTiming& timing);

}  // namespace wrenchd
