// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/inspected_device.hpp"

namespace wrenchd {

PluggedFacts plugged_facts(const UsbDevice& device) {
  PluggedFacts facts;
  facts.device.id = {device.vendor, device.product};
  facts.device.serial = device.serial;
  facts.device.product = device.product_name;
  if (device.interface >= 0) facts.device.interface = static_cast<unsigned>(device.interface);
  if (device.report_descriptor.empty()) return facts;
  facts.device.usage_page = device.usage_page;
  facts.device.usage = device.usage;
  try {
    facts.descriptor = parse_report_descriptor(device.report_descriptor);
  } catch (const DescriptorError& refused) {
    facts.unreadable = refused.what();
    return facts;
  }
  for (const DescribedReport& report : facts.descriptor->reports)
    if (report.kind == ReportKind::input)
      facts.device.in_reports.push_back({report.id.value_or(0), report.length});
  return facts;
}

}  // namespace wrenchd
