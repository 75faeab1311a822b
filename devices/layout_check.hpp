// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// A row of equal integers that is expected in a report.
struct ExpectedField {
  std::string name;  ///< name in the profile
  /// First bit of the first integer, from the start of the transmitted report, including its id.
  std::size_t bit = 0;
  unsigned bits = 0;  ///< width of one integer
  std::size_t count = 1;
  bool is_signed = false;
  /// Counts at the full deflection of a puck; 0: unknown. A device whose logical range differs by more than
  /// kMaxRangeRatio does not agree.
  double full_counts = 0.0;
};

/// Real devices of one family differ in their range by less.
inline constexpr double kMaxRangeRatio = 3.0;

/// A report that is expected from a device, independent of the format of the expectation.
struct ExpectedReport {
  ReportKind kind = ReportKind::input;
  std::optional<std::uint8_t> id;  ///< empty: the device has no report ids
  std::size_t length = 0;          ///< bytes, including the id if there is one
  std::vector<ExpectedField> fields;
  std::size_t min_length = 0;  ///< minimum length of a shorter report whose missing fields are permitted; 0:
                               ///< only `length` is permitted
  bool may_be_absent = false;  ///< true if the device may lack this report
};

/// Returns the differences between the expected reports and the device's descriptor, one line each; empty if
/// they agree.
///
///   input report 0x01: the profile has 64 bytes, the device 13
///   input report 0x01, motors_on: the profile has 1 bit, unsigned, at byte 1; the device has 01:30
///   (X), 16 bits, signed, from byte 1
///
/// Vendor layouts often describe only bytes: fields of 8 bits on a vendor page. Such bytes agree with every
/// field that lies within them. Elsewhere an expected field must match a device field with its sign, or be a
/// mask of single bits, such as buttons. Padding is not data. If the full deflection is known in counts, the
/// logical range of the device must be similar. Not RT-safe: allocates.
std::vector<std::string> find_differences(const ReportDescriptor& device,
                                          const std::vector<ExpectedReport>& expected);

}  // namespace wrenchd
