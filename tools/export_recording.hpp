// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// What of a recording is wanted.
struct ExportSettings {
  std::vector<std::string> columns;  ///< none: all
  std::size_t every = 1;             ///< so many ticks for a row
  double from_s = 0.0;               ///< since the first tick
  double to_s = std::numeric_limits<double>::infinity();
};

/// Writes ticks as CSV. First the time since the first tick, then the columns; each heading has its unit, and
/// parts of a column have names: "time_s [s],F_out.fx [N]". What stands for names is written as such. Numbers
/// read back as they were. Throws std::invalid_argument where there is no such column.
void write_csv(std::ostream& out, const Recording& recording, const ExportSettings& settings);

}  // namespace wrenchd
