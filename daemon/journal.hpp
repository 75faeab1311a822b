// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace wrenchd {

/// Fields of a journal entry beside its text, in capitals: {"WRENCHD_FAULT", "overspeed"}.
using JournalFieldList = std::vector<std::pair<std::string, std::string>>;

/// Whether standard error goes into the system's journal: then $JOURNAL_STREAM names the very file.
bool stderr_is_journal();

/// Lets everything that is logged from now on go to the journal, with its priority in place of words, and the
/// fields that are set at the time. To be called once, before other threads log.
void log_to_journal();

/// Sets fields for what the calling thread logs while this lives. Where the log goes elsewhere it does
/// nothing. Not RT safe.
class JournalFields {
 public:
  explicit JournalFields(JournalFieldList fields);
  ~JournalFields();
  JournalFields(const JournalFields&) = delete;
  JournalFields& operator=(const JournalFields&) = delete;

  /// Those of the calling thread.
  static const JournalFieldList& current() noexcept;

 private:
  JournalFieldList previous_;
};

}  // namespace wrenchd
