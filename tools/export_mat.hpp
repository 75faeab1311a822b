// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <ostream>

#include "daemon/recording/recording_file.hpp"
#include "tools/tick_selection.hpp"

namespace wrenchd {

/// Writes a recording as a MAT-file of version 5, which MATLAB, Octave and scipy.io.loadmat read:
///
///   time_s             time of each tick since the first tick [s], N x 1
///   F_out, state, ...  a variable for each selected column of /ticks, N x count, in its own type
///   contact_rows       structure: row (of the ticks, from 1) and a member for each column of /contacts
///   events             structure: time_s, tick, severity, name, text, value, conditions (JSON)
///   units, meaning     structures with a text for each column of /ticks
///   names              structure with the names of the values of enumerations and bits, from 0 or from the
///   lowest bit
///
/// Enumerations are numbers: names.state{double(state(i)) + 1} is a name. Throws std::invalid_argument if a
/// column does not exist, and std::runtime_error if a variable is too large for the format. Not RT-safe:
/// writes a stream.
void write_mat(std::ostream& out, const Recording& recording, const ExportSettings& settings);

}  // namespace wrenchd
