// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// Returns the path of a file that each hand has: with "-left" before the extension for the hand "left". An
/// empty hand is the first one, whose files have no name of a hand. An empty path stays empty. Not RT-safe.
std::filesystem::path file_of_hand(const std::filesystem::path& file, const std::string& hand);

}  // namespace wrenchd
