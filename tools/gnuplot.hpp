// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// Runs gnuplot on a script in its directory. left: what is there when that fails, for messages. Throws
/// std::runtime_error that says what to do.
void run_gnuplot(const std::filesystem::path& directory, const std::string& script, const std::string& left);

}  // namespace wrenchd
