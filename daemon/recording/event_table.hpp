// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recording/h5_handle.hpp"
#include "daemon/recording/recorded_event.hpp"

namespace wrenchd {

/// A column of /events, as /fields describes it.
struct EventColumn {
  const char* name;
  const char* type;
  const char* unit;
  const char* doc;
  const char* values;  ///< Names of the values; empty: none.
};
/// Returns the columns of /events in order. RT-safe.
std::span<const EventColumn> event_columns() noexcept;

/// The table /events of a recording: one row per event, texts of fixed size in UTF-8. Not RT-safe: writes a
/// file.
class EventTable {
 public:
  /// Creates the table in this file. ok() tells whether this succeeded.
  explicit EventTable(std::int64_t file);
  bool ok() const { return set_.ok(); }
  std::int64_t set() const { return set_; }
  /// Appends the events. Returns false if HDF5 reports an error.
  bool append(std::span<const RecordedEvent> events);

 private:
  H5Handle row_;
  H5Handle set_;
  std::uint64_t rows_ = 0;
};

/// Why a table of events cannot be read; null: it was read.
struct EventsRead {
  std::vector<RecordedEvent> events;
  const char* error = nullptr;
};
/// Reads /events, opened as `set`. Drops rows at the end that were allocated but not written when the process
/// died. most_rows: more rows than this cannot be in the file. Not RT-safe: reads a file.
EventsRead read_events(std::int64_t set, std::uint64_t most_rows);

/// Size of a row of /events in memory [bytes].
std::size_t event_row_bytes() noexcept;

}  // namespace wrenchd
