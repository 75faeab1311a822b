// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/inspected_device.hpp"

namespace wrenchd {

InspectedDevice inspect_device(const UsbDevice& device) {
  InspectedDevice inspected;
  inspected.identity.id = {device.vendor, device.product};
  inspected.identity.serial = device.serial;
  inspected.identity.product = device.product_name;
  if (device.interface >= 0) inspected.identity.interface = static_cast<unsigned>(device.interface);
  if (device.report_descriptor.empty()) return inspected;
  inspected.identity.usage_page = device.usage_page;
  inspected.identity.usage = device.usage;
  try {
    inspected.descriptor = parse_report_descriptor(device.report_descriptor);
  } catch (const DescriptorError& rejected) {
    inspected.descriptor_error = rejected.what();
    return inspected;
  }
  for (const DescribedReport& report : inspected.descriptor->reports)
    if (report.kind == ReportKind::input)
      inspected.identity.input_reports.push_back({report.id.value_or(0), report.length});
  return inspected;
}

}  // namespace wrenchd
