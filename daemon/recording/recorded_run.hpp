// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

/// What a recording ran with, made of what is in it. Its files are unpacked into a directory of their own,
/// which goes with this.
class RecordedRun {
 public:
  /// Throws RecordingError as unpack_run_config(), and std::system_error where nothing can be unpacked.
  explicit RecordedRun(const RecordingHeader& header);
  ~RecordedRun();
  RecordedRun(const RecordedRun&) = delete;
  RecordedRun& operator=(const RecordedRun&) = delete;

  const RunConfig& config() const noexcept { return config_; }

 private:
  std::filesystem::path directory_;
  RunConfig config_;
};

}  // namespace wrenchd
