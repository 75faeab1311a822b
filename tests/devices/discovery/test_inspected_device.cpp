// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/discovery/inspected_device.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_inspected_device {

namespace {

using namespace test;

UsbDevice usb(const Bytes& descriptor, std::uint16_t page, std::uint16_t usage) {
  UsbDevice device;
  device.vendor = 0x046d;
  device.product = 0xc626;
  device.serial = "A1";
  device.product_name = "SpaceNavigator";
  device.report_descriptor = descriptor;
  device.usage_page = page;
  device.usage = usage;
  return device;
}

using Reports = std::vector<std::pair<int, std::size_t>>;  ///< id and length

Reports in_reports(const Bytes& descriptor) {
  Reports reports;
  for (const InputReportSize& fact : inspect_device(usb(descriptor, 1, 8)).identity.input_reports)
    reports.emplace_back(fact.id, fact.length);
  return reports;
}

TEST_CASE("a HID device has its ids, strings, usage and input reports", "[inspected_device]") {
  const InspectedDevice facts = inspect_device(usb(space_navigator(), 0x01, 0x08));
  CHECK(text(facts.identity.id) == "046d:c626");
  CHECK(facts.identity.serial == "A1");
  CHECK(facts.identity.product == "SpaceNavigator");
  CHECK(facts.identity.usage_page == 0x01);
  CHECK(facts.identity.usage == 0x08);
  CHECK(facts.descriptor_error.empty());
  REQUIRE(facts.descriptor);
  CHECK(facts.descriptor->find(ReportKind::output, 4) != nullptr);

  CHECK(in_reports(space_navigator()) == Reports{{1, 7}, {2, 7}, {3, 3}});
  CHECK(in_reports(space_mouse_wireless()) == Reports{{1, 13}, {3, 3}, {0x17, 3}});
  CHECK(in_reports(home_made_combined()) == Reports{{1, 13}, {3, 5}});
  CHECK(in_reports(teensy_rawhid()) == Reports{{0, 64}});  // no report ids
}

TEST_CASE("a device that is not HID has no usage, without an error", "[inspected_device]") {
  const InspectedDevice facts = inspect_device(usb({}, 0, 0));
  CHECK_FALSE(facts.identity.usage_page);
  CHECK_FALSE(facts.identity.usage);
  CHECK(facts.identity.input_reports.empty());
  CHECK_FALSE(facts.descriptor);
  CHECK(facts.descriptor_error.empty());
}

TEST_CASE("a device with an invalid descriptor keeps its identity and gets the error", "[inspected_device]") {
  Bytes cut = space_navigator();
  cut.pop_back();
  const InspectedDevice facts = inspect_device(usb(cut, 0x01, 0x08));
  CHECK(facts.identity.usage == 0x08);
  CHECK(facts.identity.input_reports.empty());
  CHECK_FALSE(facts.descriptor);
  CHECK(facts.descriptor_error.find("byte 216: ") == 0);
}

TEST_CASE("every descriptor gives a result or an error", "[inspected_device]") {
  RandomValues random(31);
  for (int i = 0; i < case_count(20'000); ++i) {
    const Bytes bytes = malformed_descriptor(random);
    const InspectedDevice facts = inspect_device(usb(bytes, 1, 8));
    if (facts.descriptor.has_value() == !facts.descriptor_error.empty()) CHECK(bytes.empty());
  }
}

}  // namespace
}  // namespace wrenchd::test_inspected_device
