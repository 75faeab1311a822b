// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: devices/report_descriptor.cpp devices/layout_check.cpp devices/six_axes.cpp
#include <cstdlib>

#include "devices/layout_check.hpp"
#include "devices/report_descriptor.hpp"
#include "devices/six_axes.hpp"

/// Any bytes as a report descriptor: read, or refused at a byte that is there; and what is read can be
/// searched for axes and held against a profile. Everything else is a finding.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace wrenchd;
  static const std::vector<ExpectedReport> kExpected = {
      {ReportKind::input, 1, 13, {{"axes", 8, 16, 6, true}}},
      {ReportKind::input, {}, 64, {{"buttons", 3, 24, 1, false}, {"words", 32, 32, 8, true}}},
      {ReportKind::output, 4, 2, {{"led", 8, 1, 1, false}}}};
  try {
    const ReportDescriptor descriptor = parse_report_descriptor({data, size});
    for (const auto& report : descriptor.reports)
      for (const auto& field : report.fields) {
        if (field.end_bit() > 8 * report.length) std::abort();
        if (field.usage(field.count - 1).has_value() == field.usages.empty()) std::abort();
      }
    const SixAxesFound found = find_six_axes(descriptor);
    if (found.device.has_value() != found.why_not.empty()) std::abort();
    static_cast<void>(differences(descriptor, kExpected));
  } catch (const DescriptorError& error) {
    if (error.at() > size) std::abort();
  }
  return 0;
}
