// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "config/config_error.hpp"
#include "core/simulation_settings.hpp"

namespace wrenchd {

/// Reads a hand script into hand_script, hand_path and hand_repeats, and returns its text as it was read;
/// format: config/hands/press_and_rock.toml. Throws ConfigError and then changes nothing. Not RT-safe: reads
/// a file.
std::string load_hand_script(const std::filesystem::path& file, SimulationSettings& simulation);

}  // namespace wrenchd
