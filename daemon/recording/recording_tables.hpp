// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "collision/touch.hpp"
#include "daemon/servo/record_fields.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// A row of /ticks.
struct TickRow {
  TickRecord tick;
  std::uint64_t first_contact = 0;
  std::uint32_t contact_count = 0;
  std::uint32_t padding = 0;
};
static_assert(std::is_trivially_copyable_v<TickRow> && std::is_trivially_copyable_v<Touch>);

/// Description of one of the two tables of a recording.
struct TableKind {
  const char* path;
  const char* name;  ///< Name in messages and in /fields.
  std::size_t row_bytes;
  std::vector<RecordField> fields;
  std::uint64_t chunk_rows;
};

/// The columns of /ticks and /contacts. Not RT-safe: the first call allocates.
const TableKind& tick_table();
const TableKind& contact_table();

}  // namespace wrenchd
