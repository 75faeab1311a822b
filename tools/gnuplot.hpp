// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// Runs gnuplot on a script in its directory. left: describes for the error message which files exist if
/// gnuplot fails. Throws std::runtime_error that says what to do. Not RT-safe: runs a program.
void run_gnuplot(const std::filesystem::path& directory, const std::string& script, const std::string& left);

}  // namespace wrenchd
