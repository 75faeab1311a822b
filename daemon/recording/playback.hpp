// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "core/simulation_settings.hpp"

namespace wrenchd {

/// Where a handle was, X_BH over time, for the simulated hand to do again: the good new samples of a
/// recording, by the device's clock, or by that of the host where the device's does not rise; or a CSV file
/// (config/pose_table.hpp). Times count from the first. Throws RecordingError, PoseTableError or ConfigError,
/// each with the file, the place and the cure: also where a recording has a gap of more than kMaxTableGap_s,
/// or no sample.
std::vector<TimedPose> read_playback(const std::filesystem::path& file);

}  // namespace wrenchd
