// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// Draws a recording with gnuplot: force, torque, penetration and energy over time, the distribution of tick
/// durations, and the paths of p and q. If `output` ends in .svg, .pdf or .png, all figures go to that file.
/// Otherwise `output` is a directory, which is created; it receives one SVG per figure, the plotted tables
/// (CSV) and the gnuplot script. Returns the paths of the pictures. Throws std::runtime_error with the
/// remedy, also for a recording without ticks. Not RT-safe: writes files and runs gnuplot.
std::vector<std::filesystem::path> plot_recording(const Recording& recording,
                                                  const std::filesystem::path& output);

}  // namespace wrenchd
