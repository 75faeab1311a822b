// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wrenchd {

enum class FieldType : std::uint8_t { u8, u16, u32, u64, i64, f64 };

/// "u8", "f64"
const char* name(FieldType type) noexcept;
std::size_t size_of(FieldType type) noexcept;  ///< [bytes]

/// What the numbers of a field stand for, where they stand for names.
enum class ValueNames : std::uint8_t {
  none,
  flag,  ///< 0 or 1
  state,
  fault,
  projection_status,
  placing,
  contact_kind,
  feature_kind,
  fault_bits,  ///< from here on a name a bit, the lowest first
  command_bits,
  limit_bits,
  dof_bits,
};
constexpr bool is_bits(ValueNames names) noexcept {
  return names >= ValueNames::fault_bits;
}

/// The names, that of 0 or of bit 0 first. Empty for none and flag.
std::vector<std::string> value_names(ValueNames names);

/// One field of a record: the one place that ties its name, unit, frame and meaning to where it stands.
/// Recordings have a column of each, shared memory describes itself with them.
struct RecordField {
  const char* name;
  FieldType type;
  std::uint16_t count;  ///< of numbers
  std::size_t offset;   ///< [bytes]
  const char* unit;
  const char* frame;  ///< "" where none is meant
  const char* doc;
  ValueNames values;

  std::size_t bytes() const noexcept { return size_of(type) * count; }
};

/// Those of TickRecord, all of them, in order.
std::span<const RecordField> tick_fields() noexcept;
/// Those of Touch, likewise.
std::span<const RecordField> contact_fields() noexcept;

}  // namespace wrenchd
