// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <span>

#include "daemon/recording/recording_file.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd::test {

/// Records a runtime whose ticks the test runs. Must be created before the first tick.
class RunRecorder {
 public:
  RunRecorder(Runtime& runtime, const std::filesystem::path& file)
      : state_(runtime.enable_shared_state()), writer_(file, runtime.recording_header()) {}
  ~RunRecorder() {
    append_new_ticks();
    writer_.append(batch_);
  }
  RunRecorder(const RunRecorder&) = delete;
  RunRecorder& operator=(const RunRecorder&) = delete;

  /// Appends the ticks since the last call. Must be called at least every two seconds of loop time.
  void append_new_ticks() {
    for (; state_.read(next_, record_); ++next_)
      batch_.add(record_.tick, std::span(record_.contacts).first(record_.contact_count));
  }
  bool is_complete() const { return next_ == state_.written(); }

 private:
  SharedState& state_;
  RecordingWriter writer_;
  RecordBatch batch_;
  StateRecord record_;
  std::uint64_t next_ = 0;
};

}  // namespace wrenchd::test
