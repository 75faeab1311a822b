// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// Selects the columns and rows of an export.
struct ExportSettings {
  std::vector<std::string> columns;                       ///< Names of fields; empty exports all fields.
  std::size_t every = 1;                                  ///< Exports one tick out of this number.
  double from_s = 0.0;                                    ///< First time to export, since the first tick.
  double to_s = std::numeric_limits<double>::infinity();  ///< Last time to export, since the first tick.
};

/// Writes ticks as CSV. The first column is the time since the first tick. Each heading has a unit, and each
/// component of an array has a column: "time_s [s],F_out.fx [N]". Enumerations are written by name. Numbers
/// read back bit for bit. Throws std::invalid_argument if a column does not exist. Not RT-safe: writes a
/// stream.
void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings);

}  // namespace wrenchd
