// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <system_error>

namespace wrenchd {

/// Returns the absolute name of a file, normalized; a relative one if the working directory does not exist
/// any more. Does not access the file. Not RT-safe: allocates.
inline std::filesystem::path absolute_name(const std::filesystem::path& file) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(file, error);
  return (error ? file : absolute).lexically_normal();
}

}  // namespace wrenchd
