// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace wrenchd {

/// Kind of a HID report: device to host, host to device, or on request in either direction.
enum class ReportKind : std::uint8_t { input, output, feature };

const char* name(ReportKind kind) noexcept;

/// Meaning of a field, as in the HID usage tables: page 0x01, id 0x30 is X.
struct Usage {
  std::uint16_t page = 0;
  std::uint16_t id = 0;

  bool operator==(const Usage&) const = default;
};

/// Returns page and id in hexadecimal, "01:30", with a name for common usages: "01:30 (X)". Not RT-safe:
/// allocates.
std::string to_text(Usage usage);

/// First vendor-defined page. Only the vendor knows the meaning of these fields.
inline constexpr std::uint16_t kFirstVendorPage = 0xFF00;

/// Usages first, first + 1, ..., last of one page.
struct UsageRange {
  Usage first;
  std::uint16_t last_id = 0;
};

/// A run of equal, consecutive fields of a report: the fields of one Input, Output or Feature item.
struct DescribedField {
  /// First bit of the first field, from the start of the transmitted report, including its id.
  std::size_t bit = 0;
  unsigned bits = 0;             ///< width of one field, 1 to 256
  std::size_t count = 0;         ///< number of fields, 1 or more
  std::int64_t logical_min = 0;  ///< below 0: two's complement; otherwise unsigned
  std::int64_t logical_max = 0;
  /// Physical value of logical_min in the unit; both physical values 0: not stated.
  std::int64_t physical_min = 0;
  std::int64_t physical_max = 0;   ///< physical value of logical_max in the unit
  std::uint32_t unit = 0;          ///< code as in HID 1.11 section 6.2.2.7; 0: none
  int unit_exponent = 0;           ///< decimal exponent of the unit, -8 to 7
  std::vector<UsageRange> usages;  ///< usages in the order of the descriptor; ranges are not expanded
  bool constant = false;           ///< padding
  /// true: each field is a value of its own; false: an array of indices into the usages
  bool variable = false;
  bool relative = false;
  /// Innermost collection of the field: index into ReportDescriptor::collections.
  std::size_t collection = 0;
  std::size_t declared_at = 0;  ///< byte of the descriptor

  bool is_signed() const noexcept { return logical_min < 0; }
  std::size_t end_bit() const noexcept { return bit + bits * count; }
  /// Returns the usage of field i. If there are fewer usages than fields, the last usage applies to the rest.
  /// Empty if the descriptor names none, as for padding. RT-safe.
  std::optional<Usage> usage(std::size_t i) const noexcept;
};

/// One report; its fields are in the order of their bits.
struct DescribedReport {
  ReportKind kind = ReportKind::input;
  std::optional<std::uint8_t> id;  ///< empty: the device has one report of each kind and sends no id
  std::size_t length = 0;  ///< length in bytes as delivered by hidraw: including the id if there is one
  std::vector<DescribedField> fields;  ///< all fields without gaps, including padding
};

/// Collection of fields. Type 1 is an application: one per function of the device.
struct DescribedCollection {
  static constexpr std::size_t kOutermost = SIZE_MAX;
  static constexpr std::uint8_t kApplication = 1;

  std::uint8_t type = 0;
  Usage usage;                      ///< {0, 0} if it has none
  std::size_t parent = kOutermost;  ///< index of the enclosing collection
};

/// Content of a report descriptor.
struct ReportDescriptor {
  std::vector<DescribedReport> reports;  ///< in the order of their first occurrence
  std::vector<DescribedCollection> collections;

  bool has_ids() const noexcept { return !reports.empty() && reports.front().id.has_value(); }
  const DescribedReport* find(ReportKind kind, std::optional<std::uint8_t> id) const noexcept;
  /// Returns the usage of the outermost collection of a field: the function of the device to which it
  /// belongs. RT-safe.
  Usage application(const DescribedField& field) const noexcept;
};

/// Error: the descriptor is invalid. what() is "byte 12: what is wrong; what it should be".
class DescriptorError : public std::runtime_error {
 public:
  DescriptorError(std::size_t at, const std::string& why);
  std::size_t at() const noexcept { return at_; }  ///< byte of the descriptor, from 0

 private:
  std::size_t at_;
};

/// Parses a report descriptor, HID 1.11 section 6.2.2. Throws DescriptorError if it is truncated, unbalanced,
/// contradictory, or exceeds the limits below. The limits bound time and memory.
///
/// If HID 1.11 is ambiguous, the parser follows Linux, so that the check agrees with the kernel: a maximum is
/// unsigned unless the minimum is negative; a usage takes the page that is current when its field is
/// declared; of alternatives between delimiters it uses the first; it skips items with reserved tags; a field
/// without a Report Size or a Report Count has no bits. It is
/// stricter than Linux in these cases: it rejects a field outside every collection, a push without a pop,
/// half a usage range, and reports with and without ids in one descriptor. Not RT-safe: allocates.
ReportDescriptor parse_report_descriptor(std::span<const std::uint8_t> bytes);

// Limits. The first four are those of Linux, which does not bind a device beyond them.
inline constexpr std::size_t kMaxDescriptorBytes = 4096;
inline constexpr std::size_t kMaxDescribedReportBytes = 16384;
inline constexpr std::size_t kMaxFieldBits = 256;
inline constexpr std::size_t kMaxFieldsPerReport = 256;
inline constexpr std::size_t kMaxCollectionDepth = 32;
inline constexpr std::size_t kMaxPushDepth = 16;

}  // namespace wrenchd
