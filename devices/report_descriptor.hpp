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

/// The three ways a HID report travels: device to host, host to device, and on request either way.
enum class ReportKind : std::uint8_t { input, output, feature };

const char* name(ReportKind kind) noexcept;

/// What a number is for, as the HID usage tables name it: page 0x01, id 0x30 is X.
struct Usage {
  std::uint16_t page = 0;
  std::uint16_t id = 0;

  bool operator==(const Usage&) const = default;
};

/// "01:30", page and id in hexadecimal; with the word for it where it is one of the few we meet: "01:30 (X)".
std::string to_text(Usage usage);

/// Pages from here on are the makers' own: what is in such a field, only the maker knows.
inline constexpr std::uint16_t kFirstVendorPage = 0xFF00;

/// Usages first, first + 1, ..., last of one page.
struct UsageRange {
  Usage first;
  std::uint16_t last_id = 0;
};

/// A run of equal fields that follow each other in a report: what one Input, Output or Feature item declares.
struct DescribedField {
  std::size_t bit = 0;    ///< of the first, from the start of the report as it travels, its id included
  unsigned bits = 0;      ///< width of one, 1 to 256
  std::size_t count = 0;  ///< how many, 1 or more
  std::int64_t logical_min = 0;  ///< below 0: two's complement; otherwise unsigned
  std::int64_t logical_max = 0;
  std::int64_t physical_min = 0;   ///< what logical_min means, in the unit; both 0: nothing is said
  std::int64_t physical_max = 0;   ///< what logical_max means, likewise
  std::uint32_t unit = 0;          ///< as HID 1.11 section 6.2.2.7 codes it; 0: none
  int unit_exponent = 0;           ///< the unit is to be taken times ten to this power, -8 to 7
  std::vector<UsageRange> usages;  ///< in order, as they were written: ranges are not spread out
  bool constant = false;           ///< padding
  bool variable = false;  ///< each is a value of its own; otherwise an array of indices into the usages
  bool relative = false;
  std::size_t collection = 0;   ///< the innermost one around it: an index into ReportDescriptor::collections
  std::size_t declared_at = 0;  ///< byte of the descriptor

  bool is_signed() const noexcept { return logical_min < 0; }
  std::size_t end_bit() const noexcept { return bit + bits * count; }
  /// What the i-th is for: where there are fewer usages than fields the last one serves for the rest. Nothing
  /// where the descriptor names none, as for padding.
  std::optional<Usage> usage(std::size_t i) const noexcept;
};

/// One report, in the order of its bits.
struct DescribedReport {
  ReportKind kind = ReportKind::input;
  std::optional<std::uint8_t> id;  ///< none: the device has one report of a kind, and no id travels
  std::size_t length = 0;  ///< bytes as Linux's hidraw hands them over: the id included if there is one
  std::vector<DescribedField> fields;  ///< padding included; nothing is left out between them
};

/// Fields that belong together. Type 1 is an application: one for each thing a device wants to be.
struct DescribedCollection {
  static constexpr std::size_t kOutermost = SIZE_MAX;
  static constexpr std::uint8_t kApplication = 1;

  std::uint8_t type = 0;
  Usage usage;                      ///< {0, 0} where it has none
  std::size_t parent = kOutermost;  ///< index of the collection around it
};

/// Everything a device says of its reports.
struct ReportDescriptor {
  std::vector<DescribedReport> reports;  ///< in the order in which they are first met
  std::vector<DescribedCollection> collections;

  bool has_ids() const noexcept { return !reports.empty() && reports.front().id.has_value(); }
  const DescribedReport* find(ReportKind kind, std::optional<std::uint8_t> id) const noexcept;
  /// Usage of the outermost collection around a field: what the device wants to be with it.
  Usage application(const DescribedField& field) const noexcept;
};

/// A descriptor was refused. what() is "byte 12: what is wrong; what it should be".
class DescriptorError : public std::runtime_error {
 public:
  DescriptorError(std::size_t at, const std::string& why);
  std::size_t at() const noexcept { return at_; }  ///< byte of the descriptor, from 0

 private:
  std::size_t at_;
};

/// Reads a report descriptor, HID 1.11 section 6.2.2. Throws DescriptorError where it is cut off, does not
/// balance, contradicts itself, or asks for more than the limits below; time and memory are bounded by them.
///
/// Where HID 1.11 leaves room we read as Linux does, so that what we check is what the kernel does: a maximum
/// is unsigned unless the minimum is negative; a usage takes the page that holds when its field is declared;
/// of alternatives between delimiters the first is taken; items with reserved tags are passed over.
/// Stricter than Linux: a field outside of every collection, a push that is not popped, half a usage range,
/// and reports with and without ids side by side are refused. Not RT safe.
ReportDescriptor parse_report_descriptor(std::span<const std::uint8_t> bytes);

// Limits. The first four are those of Linux, which would not bind a device beyond them.
inline constexpr std::size_t kMaxDescriptorBytes = 4096;
inline constexpr std::size_t kMaxDescribedReportBytes = 16384;
inline constexpr std::size_t kMaxFieldBits = 256;
inline constexpr std::size_t kMaxFieldsPerReport = 256;
inline constexpr std::size_t kMaxCollectionDepth = 32;
inline constexpr std::size_t kMaxPushDepth = 16;

}  // namespace wrenchd
