// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

namespace wrenchd {

/// Returns the path that was probably meant by the path of a file that does not exist: each directory and the
/// file replaced by the nearest name beside it, the extension included. Empty: no file is near. Not RT-safe:
/// reads directories.
std::filesystem::path near_file(const std::filesystem::path& missing);

}  // namespace wrenchd
