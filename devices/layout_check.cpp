// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/layout_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace wrenchd {
namespace {

/// One of the equal fields of an item of the descriptor.
struct Cell {
  const DescribedField* field;
  std::size_t index;

  std::size_t begin() const { return field->bit + field->bits * index; }
  std::size_t end() const { return begin() + field->bits; }
  /// Vendor-defined; only the vendor knows its meaning.
  bool vendor_defined() const {
    const auto usage = field->usage(index);
    return !usage || usage->page >= kFirstVendorPage;
  }
  /// A vendor-defined byte without further structure.
  bool opaque() const { return field->bits == 8 && !field->constant && vendor_defined(); }
};

std::string id_text(std::optional<std::uint8_t> id) {
  if (!id) return "without an id";
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "0x%02x", *id);
  return text.data();
}

std::string report_text(ReportKind kind, std::optional<std::uint8_t> id) {
  return std::string(name(kind)) + " report " + id_text(id);
}

std::string place_text(std::size_t bit) {
  return "byte " + std::to_string(bit / 8) + (bit % 8 == 0 ? "" : " bit " + std::to_string(bit % 8));
}

std::string shape_text(std::size_t bits, bool is_signed, std::size_t begin) {
  return std::to_string(bits) + (bits == 1 ? " bit" : " bits") + (is_signed ? ", signed, " : ", unsigned, ") +
         (bits == 1 ? "at " : "from ") + place_text(begin);
}

std::string cells_text(const Cell& cell) {
  const std::string shape = shape_text(cell.field->bits, cell.field->is_signed(), cell.begin());
  if (cell.field->constant) return "padding, from " + place_text(cell.begin());
  const auto usage = cell.field->usage(cell.index);
  return (usage ? to_text(*usage) + ", " : "") + shape;
}

std::string cells_text(const std::vector<Cell>& cells) {
  constexpr std::size_t kMaxListed = 3;
  std::string all;
  for (std::size_t i = 0; i < std::min(cells.size(), kMaxListed); ++i)
    all += (i > 0 ? "; " : "") + cells_text(cells[i]);
  return all + (cells.size() > kMaxListed ? "; and more" : "");
}

/// Returns the device's fields that have a bit in [begin, end).
std::vector<Cell> cells_within(const DescribedReport& report, std::size_t begin, std::size_t end) {
  std::vector<Cell> cells;
  for (const DescribedField& field : report.fields) {
    const std::size_t from = std::max(begin, field.bit), to = std::min(end, field.end_bit());
    for (std::size_t bit = from; bit < to; bit = cells.back().end())
      cells.push_back({&field, (bit - field.bit) / field.bits});
  }
  return cells;
}

/// Returns true if [begin, end) can be read as one integer, given the device's cells there.
bool agrees(const std::vector<Cell>& cells, std::size_t begin, std::size_t end, bool is_signed) {
  const auto all = [&](auto holds) { return std::all_of(cells.begin(), cells.end(), holds); };
  if (all([](const Cell& cell) { return cell.field->constant; })) return false;
  if (all([](const Cell& cell) { return cell.opaque(); })) return true;
  if (cells.size() == 1) {
    const bool whole = cells[0].begin() == begin && cells[0].end() == end;
    if (whole) return cells[0].field->bits == 1 || cells[0].field->is_signed() == is_signed;
    return cells[0].vendor_defined() && !is_signed;  // some bits of a vendor-defined word
  }
  // A mask: single bits, and padding in unused positions.
  return all([](const Cell& cell) { return cell.field->bits == 1 || cell.field->constant; });
}

/// Returns true if a report of the device is shorter than expected, but long enough.
bool acceptably_short(const DescribedReport& device, const ExpectedReport& expected_report) {
  return expected_report.min_length != 0 && device.length >= expected_report.min_length &&
         device.length < expected_report.length;
}

/// Returns how the logical range of the device differs from the full deflection of the profile.
std::optional<std::string> range_difference(const DescribedField& device, const ExpectedField& field) {
  const auto largest =
      static_cast<double>(std::max(std::abs(device.logical_min), std::abs(device.logical_max)));
  if (!(field.full_counts > 0.0) || largest == 0.0) return {};
  if (largest <= kMaxRangeRatio * field.full_counts && field.full_counts <= kMaxRangeRatio * largest)
    return {};
  return "full deflection is " + std::to_string(std::lround(field.full_counts)) +
         " counts in the profile; the device counts from " + std::to_string(device.logical_min) + " to " +
         std::to_string(device.logical_max) + ": use a profile with another step";
}

/// Returns the difference of one field, only once even if several of its integers differ.
std::optional<std::string> difference(const DescribedReport& device, const ExpectedField& field,
                                      bool may_be_short) {
  for (std::size_t i = 0; i < field.count; ++i) {
    const std::size_t begin = field.bit + i * field.bits;
    const std::size_t whole_end = begin + field.bits;
    const std::size_t end = may_be_short ? std::min(whole_end, 8 * device.length) : whole_end;
    if (begin >= end) return {};  // missing bytes read as 0
    const std::string report_name = field.name + (field.count > 1 ? "[" + std::to_string(i) + "]" : "") +
                                    ": the profile has " + shape_text(field.bits, field.is_signed, begin) +
                                    "; ";
    if (end > 8 * device.length)
      return report_name + "the device's report ends with byte " + std::to_string(device.length - 1);
    const std::vector<Cell> cells = cells_within(device, begin, end);
    if (cells.empty()) return report_name + "the device declares nothing there";
    if (!agrees(cells, begin, end, field.is_signed))
      return report_name + "the device has " + cells_text(cells);
    if (const auto range = range_difference(*cells.front().field, field)) return field.name + ": " + *range;
  }
  return {};
}

std::string ids_of(const ReportDescriptor& device, ReportKind kind) {
  std::string ids;
  for (const DescribedReport& report : device.reports)
    if (report.kind == kind) ids += (ids.empty() ? "" : ", ") + id_text(report.id);
  return ids.empty() ? "it has no " + std::string(name(kind)) + " report"
                     : "its " + std::string(name(kind)) + " reports: " + ids;
}

}  // namespace

std::vector<std::string> find_differences(const ReportDescriptor& device,
                                          const std::vector<ExpectedReport>& expected) {
  std::vector<std::string> lines;
  for (const ExpectedReport& expected_report : expected) {
    const std::string report_name = report_text(expected_report.kind, expected_report.id);
    const DescribedReport* report = device.find(expected_report.kind, expected_report.id);
    if (report == nullptr) {
      if (expected_report.may_be_absent) continue;
      lines.push_back(report_name + ": the device has no such report; " +
                      ids_of(device, expected_report.kind));
      continue;
    }
    const bool is_short = acceptably_short(*report, expected_report);
    if (report->length != expected_report.length && !is_short)
      lines.push_back(report_name + ": the profile has " + std::to_string(expected_report.length) +
                      " bytes, the device " + std::to_string(report->length));
    for (const ExpectedField& field : expected_report.fields)
      if (const auto line = difference(*report, field, is_short)) lines.push_back(report_name + ", " + *line);
  }
  return lines;
}

}  // namespace wrenchd
