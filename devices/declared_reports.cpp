// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/declared_reports.hpp"

#include "devices/report_descriptor.hpp"

namespace wrenchd {

DeclaredReports::DeclaredReports(std::span<const std::uint8_t> descriptor) {
  if (descriptor.empty()) return;
  try {
    const ReportDescriptor parsed = parse_report_descriptor(descriptor);
    numbered_ = parsed.has_ids();
    for (const DescribedReport& report : parsed.reports)
      if (report.kind == ReportKind::input)
        length_[report.id.value_or(0)] = static_cast<std::uint16_t>(report.length);
  } catch (const DescriptorError&) {  // an invalid descriptor declares nothing
  }
}

bool DeclaredReports::contains(std::span<const std::uint8_t> report) const noexcept {
  if (report.empty()) return false;
  return length_[numbered_ ? report[0] : 0] == report.size();
}

}  // namespace wrenchd
