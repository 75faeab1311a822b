// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "core/simulation_settings.hpp"

namespace wrenchd {

/// Reads where the simulated hand goes into hand_script, hand_path and hand_repeats;
/// config/hands/press_and_rock.toml shows the format. Throws ConfigError and then changes nothing.
void load_hand_script(const std::filesystem::path& file, SimulationSettings& simulation);

}  // namespace wrenchd
