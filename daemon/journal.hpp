// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace spdlog::sinks {
class sink;
}

namespace wrenchd {

/// Fields of a journal entry beside its text. Names are in capitals: {"WRENCHD_FAULT", "overspeed"}.
using JournalFieldList = std::vector<std::pair<std::string, std::string>>;

/// Returns true if standard error is connected to the system journal, which $JOURNAL_STREAM states. Not
/// RT-safe: system call.
bool stderr_is_journal();

/// Returns a sink that sends log entries to the system journal, with priority and the JournalFields of the
/// thread that calls it. Its log() waits for the journal. Not RT-safe: allocates.
std::shared_ptr<spdlog::sinks::sink> make_journal_sink();

/// Adds fields to the log entries of the calling thread while this object lives. Has no effect if the log
/// does not go to the journal. Not RT-safe: allocates.
class JournalFields {
 public:
  explicit JournalFields(JournalFieldList fields);
  ~JournalFields();
  JournalFields(const JournalFields&) = delete;
  JournalFields& operator=(const JournalFields&) = delete;

  /// Fields of the calling thread.
  static const JournalFieldList& current() noexcept;

 private:
  JournalFieldList previous_;
};

}  // namespace wrenchd
