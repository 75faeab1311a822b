// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: devices/report_descriptor.cpp devices/layout_check.cpp devices/six_axes.cpp
#include <cstdlib>

#include "devices/layout_check.hpp"
#include "devices/report_descriptor.hpp"
#include "devices/six_axes.hpp"

/// Reads any bytes as a report descriptor. The parser returns a descriptor that find_six_axes() and
/// find_differences() accept, or throws DescriptorError with an offset inside the bytes.
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
    const SixAxisResult result = find_six_axes(descriptor);
    if (result.controller.has_value() != result.rejection.empty()) std::abort();
    static_cast<void>(find_differences(descriptor, kExpected));
  } catch (const DescriptorError& error) {
    if (error.at() > size) std::abort();
  }
  return 0;
}
