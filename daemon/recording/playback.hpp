// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "core/simulation_settings.hpp"

namespace wrenchd {

/// Reads handle poses X_BH over time for the playback by a simulated device. The file is a recording or a CSV
/// file (config/pose_table.hpp). Of a recording, the function returns all fresh samples without a fault.
/// Their times are those of the device clock, or of the host clock if the device clock does not increase. The
/// first time is 0. Throws RecordingError, PoseTableError or ConfigError with file, place and cure, also if a
/// recording has no sample or a gap longer than kMaxTableGap_s. Not RT-safe: reads a file.
std::vector<TimedPose> read_playback(const std::filesystem::path& file);

}  // namespace wrenchd
