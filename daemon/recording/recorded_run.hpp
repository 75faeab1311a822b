// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

/// The run configuration of a recording. The constructor unpacks the files of the recording into a temporary
/// directory, and the destructor removes it. Not RT-safe: writes files.
class RecordedRun {
 public:
  /// Throws RecordingError as unpack_run_config(), and std::system_error if the directory cannot be created.
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
