// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/inspected_device.hpp"

namespace wrenchd {

InspectedDevice inspect_device(const UsbDevice& device) {
  InspectedDevice facts;
  facts.identity.id = {device.vendor, device.product};
  facts.identity.serial = device.serial;
  facts.identity.product = device.product_name;
  if (device.interface >= 0) facts.identity.interface = static_cast<unsigned>(device.interface);
  if (device.report_descriptor.empty()) return facts;
  facts.identity.usage_page = device.usage_page;
  facts.identity.usage = device.usage;
  try {
    facts.descriptor = parse_report_descriptor(device.report_descriptor);
  } catch (const DescriptorError& refused) {
    facts.descriptor_error = refused.what();
    return facts;
  }
  for (const DescribedReport& report : facts.descriptor->reports)
    if (report.kind == ReportKind::input)
      facts.identity.input_reports.push_back({report.id.value_or(0), report.length});
  return facts;
}

}  // namespace wrenchd
