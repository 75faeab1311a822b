// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <ostream>

#include "daemon/recording/recording_file.hpp"
#include "tools/tick_selection.hpp"

namespace wrenchd {

/// Writes a recording as MCAP with JSON messages, for Foxglove and other readers of MCAP:
///
///   /ticks                          wrenchd.Tick: every selected column of /ticks, arrays as objects:
///   F_out.fx /tf                             foxglove.FrameTransform: tool_commanded and tool_proxy in
///   world, handle in base /pose/commanded, /pose/proxy    foxglove.PoseInFrame in world /wrench/out,
///   /wrench/body       wrenchd.Wrench: F_out about the point of the profile, F_T in axes of the tool /events
///   foxglove.Log: events of the daemon, and markers /conditions                     wrenchd.Conditions:
///   marker and conditions, at each marker
///
/// All times are UTC [ns since 1970]: started_unix_ns + (now_ns - started_ns). Numbers read back to the same
/// value; JSON has no NaN and no infinity, which are null. A pose that is not valid has no message. Throws
/// std::invalid_argument if a column does not exist. Not RT-safe: writes a stream.
void write_mcap(std::ostream& out, const Recording& recording, const ExportSettings& settings);

}  // namespace wrenchd
