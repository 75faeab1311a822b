// SPDX-License-Identifier: GPL-3.0-or-later
#include <cerrno>

#include <catch2/catch.hpp>

#include "devices/discovery/usb_devices.hpp"
#include "tests/devices/usb/mock_device.hpp"

namespace wrenchd::test_usb_devices {

using namespace wrenchd::test;
using Catch::Contains;

TEST_CASE("without devices the list is empty", "[usb]") {
  const MockMachine machine;
  CHECK(list_usb_devices().empty());
}

TEST_CASE("a HID device is listed with all its properties", "[usb]") {
  MockMachine machine;
  const MockHidraw device(machine, {.place = "3-1.2", .number = 4, .serial = "S 7"});
  const auto found = list_usb_devices();
  REQUIRE(found.size() == 1);
  CHECK(found[0].hidraw_node == "/dev/hidraw4");
  CHECK(found[0].usb_node == "/dev/bus/usb/003/006");
  CHECK(found[0].port_path == "3-1.2");
  CHECK(found[0].interface == 0);
  CHECK(found[0].vendor == 0x1209);
  CHECK(found[0].product == 0x6d0f);
  CHECK(found[0].serial == "S 7");
  CHECK(found[0].manufacturer == "wrenchd");
  CHECK(found[0].product_name == "mock device");
  CHECK(found[0].report_descriptor == report_descriptor(true));
  CHECK(found[0].usage_page == 0xFF00);
  CHECK(found[0].usage == 1);
  CHECK(found[0].numbered_reports);
  CHECK(describe(found[0]) == "1209:6d0f serial S 7 in 3-1.2, interface 0");
}

TEST_CASE("a device without report ids is listed as such", "[usb]") {
  MockMachine machine;
  const MockHidraw device(machine, {.numbered_reports = false});
  CHECK_FALSE(list_usb_devices().at(0).numbered_reports);
}

TEST_CASE("an interface that is not HID has no node, descriptor or usage", "[usb]") {
  MockMachine machine;
  const MockUsb device(machine, {.place = "1-4", .vendor = "0403", .product = "cb48", .hid = false});
  const auto found = list_usb_devices();
  REQUIRE(found.size() == 1);
  CHECK(found[0].hidraw_node.empty());
  CHECK(found[0].report_descriptor.empty());
  CHECK(found[0].usage_page == 0);
  CHECK(found[0].vendor == 0x0403);
  CHECK(found[0].port_path == "1-4");
}

TEST_CASE("devices are sorted by port path, numerically, independent of their order", "[usb]") {
  MockMachine machine;
  const MockHidraw c(machine, {.place = "1-10", .number = 0, .serial = "C"});
  const MockHidraw a(machine, {.place = "1-2", .number = 2, .serial = "A"});
  const MockHidraw d(machine, {.place = "2-1", .number = 1, .serial = "D"});
  const MockHidraw b(machine, {.place = "1-2.1", .number = 3, .serial = "B"});
  std::string serials;
  for (const UsbDevice& device : list_usb_devices()) serials += device.serial;
  CHECK(serials == "ABCD");
}

TEST_CASE("two equal devices are distinguished by their serial numbers", "[usb]") {
  MockMachine machine;
  const MockHidraw left(machine, {.place = "1-1", .number = 0, .serial = "L"});
  const MockHidraw right(machine, {.place = "1-2", .number = 1, .serial = "R"});
  const auto found = list_usb_devices();
  REQUIRE(found.size() == 2);
  CHECK_FALSE(found[0].is_same_device(found[1]));
  UsbDevice moved = found[1];
  moved.port_path = "1-9";
  moved.hidraw_node = "/dev/hidraw9";
  CHECK(moved.is_same_device(found[1]));
  moved.serial = "L";
  CHECK(moved.is_same_device(found[0]));
  moved.report_descriptor.pop_back();
  CHECK_FALSE(moved.is_same_device(found[0]));
}

TEST_CASE("an unplugged device is not listed", "[usb]") {
  MockMachine machine;
  MockHidraw device(machine, {});
  CHECK(list_usb_devices().size() == 1);
  device.unplug();
  CHECK(list_usb_devices().empty());
}

TEST_CASE("without permission the error contains the udev rule", "[usb]") {
  UsbDevice device;
  device.vendor = 0x256f;
  device.product = 0xc635;
  device.hidraw_node = "/dev/hidraw3";
  device.usb_node = "/dev/bus/usb/001/002";
  CHECK_THAT(open_error(device, device.hidraw_node, EACCES),
             Contains("/dev/hidraw3") && Contains("256f:c635") &&
                 Contains(R"(SUBSYSTEM=="hidraw", ATTRS{idVendor}=="256f", ATTRS{idProduct}=="c635", )"
                          R"(GROUP="wrenchd", MODE="0660")"));
  CHECK_THAT(open_error(device, device.usb_node, EACCES),
             Contains(R"(SUBSYSTEM=="usb", ATTR{idVendor}=="256f", ATTR{idProduct}=="c635")"));
  CHECK_THAT(open_error(device, device.hidraw_node, ENODEV), Contains("no longer connected"));
  CHECK_THAT(open_error(device, device.usb_node, EBUSY), Contains("another program uses it"));
}

TEST_CASE("open_error() asks the system whether a node can be opened", "[usb]") {
  MockMachine machine;
  MockHidraw mock(machine, {});
  const UsbDevice device = list_usb_devices().at(0);
  CHECK(open_error(device, device.hidraw_node).empty());
  mock.unplug();
  CHECK_THAT(open_error(device, "/dev/hidraw77"), Contains("/dev/hidraw77"));
}

TEST_CASE("bus and ports are part of the path of all devices below them", "[usb]") {
  CHECK(port_path_in(
            "/devices/pci0000:00/0000:00:14.0/usb3/3-1/3-1.2/3-1.2:1.0/0003:1209:6D0F.0001/hidraw/hidraw0") ==
        "3-1.2");
  CHECK(port_path_in("/devices/platform/vhci_hcd.0/usb1/1-1") == "1-1");
  CHECK(port_path_in("/devices/virtual/misc/uhid/0005:1209:6D0F.0001/hidraw/hidraw0").empty());
  CHECK(port_path_in("").empty());
  CHECK(port_path_in("-/1-/-1/1-a/a-1").empty());
}

}  // namespace wrenchd::test_usb_devices
