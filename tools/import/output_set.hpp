// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace wrenchd {

/// Output files that appear together. Until commit() they have temporary names, which the destructor removes.
/// Not RT-safe: writes files.
class OutputSet {
 public:
  OutputSet() = default;
  ~OutputSet();
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  /// Writes the content under a temporary name. Throws std::runtime_error that says what to do.
  void add(const std::filesystem::path& file, const std::string& content);
  /// Gives all files their names, in the order of add(). Throws std::runtime_error.
  void commit();

 private:
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> staged_;  ///< temporary and final name
};

}  // namespace wrenchd
