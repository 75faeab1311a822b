// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <ostream>

#include "daemon/recording/recording_file.hpp"
#include "tools/tick_selection.hpp"

namespace wrenchd {

/// Writes ticks as CSV. The first column is the time since the first tick. Each heading has a unit, and each
/// component of an array has a column: "time_s [s],F_out.fx [N]". Enumerations are written by name. If the
/// recording has markers, the last columns are "marker", the label of the newest one, and each condition,
/// which holds until a marker changes it. Numbers read back bit for bit. Throws std::invalid_argument if a
/// column does not exist. Not RT-safe: writes a stream.
void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings);

}  // namespace wrenchd
