// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "core/simulation_settings.hpp"

namespace wrenchd {

/// Reads a hand script into hand_script, hand_path and hand_repeats; format:
/// config/hands/press_and_rock.toml. texts: receives the text of the file, if given. Throws ConfigError and
/// then changes nothing. Not RT-safe: reads a file.
void load_hand_script(const std::filesystem::path& file, SimulationSettings& simulation,
                      LoadedTexts* texts = nullptr);

}  // namespace wrenchd
