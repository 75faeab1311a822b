// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// Draws what papers show of a run, by gnuplot: force, torque, penetration and energy over time, the time of
/// ticks with its tail, and the way of p and of q. Where `output` ends in .svg, .pdf or .png it becomes that
/// one file; else a directory, which is made, with an SVG for each figure, the tables they show (CSV) and the
/// script, to draw them again in another style. Returns the pictures. Throws std::runtime_error that says
/// what to do, also for a recording without ticks.
std::vector<std::filesystem::path> plot_recording(const Recording& recording,
                                                  const std::filesystem::path& output);

}  // namespace wrenchd
