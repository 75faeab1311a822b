// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// A row of equal integers that somebody expects in a report.
struct ExpectedField {
  std::string name;     ///< as the profile calls it
  std::size_t bit = 0;  ///< of the first, from the start of the report as it travels, its id included
  unsigned bits = 0;    ///< width of one
  std::size_t count = 1;
  bool is_signed = false;
};

/// A report that somebody expects of a device, whatever format they wrote it down in.
struct ExpectedReport {
  ReportKind kind = ReportKind::input;
  std::optional<std::uint8_t> id;  ///< none: the device has no report ids
  std::size_t length = 0;          ///< bytes, the id included if there is one
  std::vector<ExpectedField> fields;
  std::size_t min_length = 0;  ///< a shorter one that will do: fields end where it ends; 0: none will
  bool may_be_absent = false;  ///< the device need not have it
};

/// What an expectation and the device's own descriptor disagree about, a line each; empty where they agree.
///
///   input report 0x01: the profile says 64 bytes, the device 13
///   input report 0x01, motors_on: the profile says 1 bit, unsigned, at byte 1; there the device has 01:30
///   (X), 16 bits, signed, from byte 1
///
/// Makers of private layouts describe bytes, no more: fields of 8 bits on a page of their own. Such bytes
/// agree with everything that lies within them. Elsewhere a field must be one of the device's, with its sign,
/// or a mask of its single bits, as of buttons. Padding is no data. Not RT safe.
std::vector<std::string> find_differences(const ReportDescriptor& device,
                                          const std::vector<ExpectedReport>& expected);

}  // namespace wrenchd
