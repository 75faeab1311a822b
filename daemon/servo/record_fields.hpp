// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wrenchd {

/// Type of one number of a field.
enum class FieldType : std::uint8_t { u8, u16, u32, u64, i64, f64 };

/// Returns "u8", "u16", "u32", "u64", "i64" or "f64". RT-safe.
const char* name(FieldType type) noexcept;
/// Returns the size of a number in bytes. RT-safe.
std::size_t size_of(FieldType type) noexcept;

/// The names that the values of a field stand for.
enum class ValueNames : std::uint8_t {
  none,  ///< The field is a plain number.
  flag,  ///< The field is 0 or 1.
  state,
  fault,
  projection_status,
  proxy_initialization,
  contact_kind,
  feature_kind,
  fault_bits,  ///< From here on each bit has a name.
  command_bits,
  limit_bits,
  dof_bits,
};
constexpr bool is_bits(ValueNames names) noexcept {
  return names >= ValueNames::fault_bits;
}

/// Returns the names; the first is that of value 0, or of bit 0. Returns an empty list for `none` and `flag`.
/// Not RT-safe: allocates.
std::vector<std::string> value_names(ValueNames names);

/// Name and unit of one component of an array field, for example "fx" and "N".
struct FieldComponent {
  const char* name;
  const char* unit;
};

/// One field of a record: where it is, and what it means. Recordings, shared memory, export and view are
/// driven by these descriptions.
struct RecordField {
  const char* name;
  FieldType type;
  std::uint16_t count;  ///< Number of components.
  std::size_t offset;   ///< Offset in the record [bytes].
  const char* unit;     ///< Unit of a scalar; units of all components of an array.
  const char* frame;    ///< Frame of reference; empty if the field has none.
  const char* doc;      ///< Meaning.
  ValueNames values;
  std::span<const FieldComponent> components = {};  ///< Components of an array; empty if they have no names.

  std::size_t bytes() const noexcept { return size_of(type) * count; }  ///< Size of the field. RT-safe.
};

/// Returns all fields of TickRecord in order, from daemon/servo/tick_fields.def. RT-safe.
std::span<const RecordField> tick_fields() noexcept;
/// Returns all fields of Touch in order. RT-safe.
std::span<const RecordField> contact_fields() noexcept;

}  // namespace wrenchd
