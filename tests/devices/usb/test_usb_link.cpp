// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <memory>
#include <numeric>
#include <thread>

#include <catch2/catch.hpp>

#include "devices/links/usb_link.hpp"
#include "tests/devices/usb/mock_device.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_usb_link {

using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Contains;

namespace {

TimePoint now() {
  return std::chrono::steady_clock::now();
}

/// Settings without deadlines, so that a slow machine does not matter.
LinkSettings patient() {
  return {.write_deadline = 1h, .close_timeout = 10s};
}

struct Bench {
  MockMachine machine;
  MockUsb mock;
  UsbLink link;

  explicit Bench(const MockIdentity& identity = {}, const LinkSettings& settings = patient())
      : mock(machine, identity), link(list_usb_devices().at(0), settings) {
    link.open();
  }
};

Bytes numbered(std::size_t length, std::uint8_t first) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), first);
  return bytes;
}

std::pair<LinkRead, Bytes> read_one(ReportLink& link) {
  Bytes buffer(64);
  link.wait_readable(now() + 1h);
  const LinkRead read = link.read(now(), buffer);
  buffer.resize(std::min(read.length, buffer.size()));
  return {read, buffer};
}

}  // namespace

TEST_CASE("libusb: several read transfers are submitted at once", "[usb]") {
  Bench bench;
  while (bench.mock.in_flight() < 8) std::this_thread::yield();
  CHECK(bench.mock.claimed());
  std::array<std::uint8_t, 64> buffer{};
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
  bench.link.wait_readable(now() + 1ms);
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
}

TEST_CASE("libusb: the kernel driver is detached while the link is open, then attached again", "[usb]") {
  Bench bench;
  CHECK_FALSE(bench.mock.kernel_driver());
  bench.link.close();
  CHECK(bench.mock.kernel_driver());
}

TEST_CASE("libusb: reports are read in order, each with its length", "[usb]") {
  const bool hid = GENERATE(true, false);  // interrupt and bulk endpoints
  Bench bench({.hid = hid});
  for (int round = 0; round < 20; ++round)
    for (const std::size_t length : {64U, 1U, 32U, 63U, 64U}) {
      const Bytes report = numbered(length, static_cast<std::uint8_t>(round));
      bench.mock.send(report);
      const TimePoint before = now() - 1h;
      const auto [read, bytes] = read_one(bench.link);
      REQUIRE(read.status == LinkStatus::ok);
      REQUIRE(bytes == report);
      REQUIRE(read.arrived > before);
      REQUIRE(read.arrived <= now());
    }
  CHECK(bench.link.counts().dropped == 0);
}

TEST_CASE("libusb: if the host does not read, the newest reports are lost and counted", "[usb]") {
  Bench bench;
  for (int i = 0; i < 100; ++i) bench.mock.send(Bytes(64, static_cast<std::uint8_t>(i)));
  while (bench.link.counts().dropped < 36) std::this_thread::yield();
  for (int i = 0; i < 64; ++i)
    REQUIRE(read_one(bench.link).second == Bytes(64, static_cast<std::uint8_t>(i)));
  std::array<std::uint8_t, 64> buffer{};
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
  CHECK(bench.link.counts().dropped == 36);
}

TEST_CASE("libusb: reports are written unchanged", "[usb]") {
  Bench bench;
  for (std::uint8_t i = 0; i < 20; ++i) {
    CHECK(bench.link.write(now(), numbered(32, i)) == LinkStatus::ok);
    CHECK(bench.mock.receive() == numbered(32, i));
  }
}

TEST_CASE("libusb: reports to a HID interface without an OUT endpoint are sent as SET_REPORT", "[usb]") {
  const bool has_ids = GENERATE(true, false);
  MockMachine machine;
  MockUsb mock(machine, {.out_endpoint = false});
  UsbDevice device = list_usb_devices().at(0);
  device.numbered_reports = has_ids;
  UsbLink link(device, patient());
  link.open();
  for (std::uint8_t id = 2; id < 9; ++id) {
    CHECK(link.write(now(), numbered(32, id)) == LinkStatus::ok);
    CHECK(mock.receive() == numbered(32, id));
    CHECK(mock.set_report() == std::pair(0x200 + (has_ids ? id : 0), 0));  // output report, interface 0
  }
  mock.set_blocked(true);
  link.write(now(), Bytes(32, 1));
  link.write(now(), Bytes(32, 0));
  std::thread closing([&] { link.close(); });
  std::this_thread::sleep_for(20ms);
  mock.set_blocked(false);
  Bytes last;
  do last = mock.receive();
  while (last != Bytes(32, 0));
  closing.join();
}

TEST_CASE("libusb: a device that is not HID and has no OUT endpoint accepts no reports", "[usb]") {
  Bench bench({.hid = false, .out_endpoint = false});
  CHECK(bench.link.write(now(), Bytes(32, 1)) == LinkStatus::not_ready);
}

TEST_CASE("libusb: status bytes before each packet are removed, and packets without data are dropped",
          "[usb]") {
  LinkSettings settings = patient();
  settings.prefix_bytes = 2;
  Bench bench({.hid = false}, settings);
  bench.mock.send({0x31, 0x60});
  bench.mock.send({0x31, 0x60, 7, 8, 9});
  CHECK(read_one(bench.link).second == Bytes{7, 8, 9});
}

TEST_CASE("libusb: reports are assembled from the packets of a serial chip", "[usb]") {
  LinkSettings settings = patient();
  settings.prefix_bytes = 2;
  settings.frame = {4, '<', '>'};
  Bench bench({.hid = false}, settings);
  bench.mock.send({0x31, 0x60, '<', 1, 2, '>'});
  CHECK(read_one(bench.link).second == Bytes{'<', 1, 2, '>'});
  bench.mock.send({0x31, 0x60, '<', 3});
  bench.mock.send({0x31, 0x60});
  bench.mock.send({0x31, 0x60, 4, '>', '<', 5, 6, '>'});
  CHECK(read_one(bench.link).second == Bytes{'<', 3, 4, '>'});
  CHECK(read_one(bench.link).second == Bytes{'<', 5, 6, '>'});
  bench.mock.send({0x31, 0x60, '<', 7, '>', '<', 8, 9, '>'});  // one of the reports is too short
  CHECK(read_one(bench.link).second == Bytes{'<', 8, 9, '>'});
}

TEST_CASE("libusb: the configured endpoints are used, or the link is rejected", "[usb]") {
  MockMachine machine;
  MockUsb mock(machine, {});
  LinkSettings settings = patient();
  settings.in_endpoint = 0x82;
  UsbLink link(list_usb_devices().at(0), settings);
  CHECK_THROWS_WITH(link.open(), Contains("no interrupt or bulk IN endpoint"));
}

TEST_CASE("libusb: while the device accepts nothing, the newest report waits", "[usb]") {
  Bench bench;
  bench.mock.set_blocked(true);
  bench.link.write(now(), Bytes(32, 1));
  bench.link.write(now(), Bytes(32, 2));
  bench.link.write(now(), Bytes(32, 3));
  bench.mock.set_blocked(false);
  Bytes report;
  do report = bench.mock.receive();
  while (report != Bytes(32, 3));
  while (bench.link.slot()->written() == 0) std::this_thread::yield();
}

TEST_CASE("libusb: a report that is not accepted by its deadline is replaced by the newest", "[usb]") {
  Bench bench({}, {.write_deadline = 2ms, .close_timeout = 10s});
  bench.mock.set_blocked(true);
  bench.link.write(now(), Bytes(32, 1));
  while (bench.link.slot()->failed() == 0) std::this_thread::yield();
  CHECK(bench.link.write(now(), Bytes(32, 2)) ==
        LinkStatus::not_ready);  // reports the failure of the previous write
  while (bench.link.slot()->failed() < 2) std::this_thread::yield();
  bench.mock.set_blocked(false);
  bench.link.write(now(), Bytes(32, 3));
  CHECK(bench.mock.receive() == Bytes(32, 3));
}

TEST_CASE("libusb: the last submitted report is written before the link closes", "[usb]") {
  Bench bench;
  for (int i = 0; i < 50; ++i) bench.link.write(now(), Bytes(32, 1));
  bench.link.write(now(), Bytes(32, 0));
  bench.link.close();
  Bytes last;
  do last = bench.mock.receive();
  while (last != Bytes(32, 0));
  CHECK(bench.mock.in_flight() == 0);
  CHECK_FALSE(bench.mock.claimed());
  CHECK(bench.link.write(now(), Bytes(32, 1)) == LinkStatus::disconnected);
}

TEST_CASE("libusb: closing waits for a device that accepts the last report late", "[usb]") {
  Bench bench;
  bench.mock.set_blocked(true);
  bench.link.write(now(), Bytes(32, 1));
  bench.link.write(now(), Bytes(32, 0));
  std::thread closing([&] { bench.link.close(); });
  std::this_thread::sleep_for(20ms);  // then it waits; otherwise the test covers less
  bench.mock.set_blocked(false);
  Bytes last;
  do last = bench.mock.receive();
  while (last != Bytes(32, 0));
  closing.join();
}

TEST_CASE("libusb: closing does not wait for a device that accepts nothing", "[usb]") {
  Bench bench({}, {.write_deadline = 1h, .close_timeout = 1ms});
  bench.mock.set_blocked(true);
  bench.link.write(now(), Bytes(32, 1));
  bench.link.close();
  CHECK_FALSE(bench.mock.claimed());
}

TEST_CASE("libusb: a halted endpoint is cleared and read again", "[usb]") {
  Bench bench;
  for (int i = 1; i <= 3; ++i) {
    bench.mock.stall();
    while (bench.mock.halts_cleared() < i) std::this_thread::yield();
    bench.mock.send(numbered(64, 5));
    CHECK(read_one(bench.link).second == numbered(64, 5));
  }
  CHECK(bench.link.counts().stalls >= 3);
}

TEST_CASE("libusb: an unplugged device is disconnected, even with pending transfers", "[usb]") {
  Bench bench;
  bench.mock.send(numbered(64, 1));
  bench.mock.unplug();
  std::array<std::uint8_t, 64> buffer{};
  while (bench.link.read(now(), buffer).status != LinkStatus::disconnected) std::this_thread::yield();
  bench.link.wait_readable(now() + 1h);
  CHECK(bench.link.write(now(), Bytes(32, 1)) == LinkStatus::disconnected);
  bench.link.close();
  bench.link.close();
  CHECK_THROWS_WITH(bench.link.open(), Contains("no longer connected"));
}

TEST_CASE("libusb: another device in the same port is rejected, and nothing is written to it", "[usb]") {
  MockMachine machine;
  MockIdentity identity{.serial = "MINE"};
  auto mock = std::make_unique<MockUsb>(machine, identity);
  UsbLink link(list_usb_devices().at(0));
  mock.reset();
  SECTION("another serial number") {
    identity.serial = "YOURS";
  }
  SECTION("another product") {
    identity.product = "0001";
  }
  MockUsb other(machine, identity);
  CHECK_THROWS_WITH(link.open(), Contains("1-1") && Contains("nothing was written"));
  CHECK_FALSE(other.claimed());
}

TEST_CASE("libusb: a device with another report descriptor is rejected, and nothing is written to it",
          "[usb]") {
  MockMachine machine;
  const MockUsb mock(machine, {});
  UsbDevice device = list_usb_devices().at(0);
  device.report_descriptor = report_descriptor(true);
  {
    UsbLink same(device);
    CHECK_NOTHROW(same.open());
  }
  device.report_descriptor = report_descriptor(false);
  UsbLink other(device);
  CHECK_THROWS_WITH(other.open(), Contains("another report descriptor") && Contains("nothing was written"));
  CHECK_FALSE(mock.claimed());
}

TEST_CASE("libusb: two equal devices are read independently", "[usb]") {
  MockMachine machine;
  MockUsb left(machine, {.place = "1-1", .number = 0, .serial = "L"});
  MockUsb right(machine, {.place = "1-2", .number = 1, .serial = "R"});
  const auto found = list_usb_devices();
  UsbLink l(found.at(0), patient()), r(found.at(1), patient());
  r.open();
  l.open();
  left.send(numbered(64, 1));
  right.send(numbered(64, 101));
  CHECK(read_one(r).second == numbered(64, 101));
  CHECK(read_one(l).second == numbered(64, 1));
}

TEST_CASE("libusb: a device that is not on USB is rejected with the alternative", "[usb]") {
  UsbDevice device;
  device.hidraw_node = "/dev/hidraw0";
  CHECK_THROWS_WITH(UsbLink(device).open(), Contains("use hidraw"));
}

TEST_CASE("libusb: reading and submitting neither allocate nor lock", "[usb][realtime]") {
  Bench bench;
  std::array<std::uint8_t, 64> buffer{};
  int read = 0;
  std::uint64_t seen = 0;
  for (int i = 0; i < 20; ++i) {
    bench.mock.send(numbered(64, 1));
    const RealtimeGuard guard;
    while (bench.link.read(TimePoint{1h}, buffer).status != LinkStatus::ok) std::this_thread::yield();
    ++read;
    bench.link.write(TimePoint{1h}, std::span(buffer).first(32));
    seen += guard.allocations();
  }
  CHECK(read == 20);
  CHECK(seen == 0);
}

}  // namespace wrenchd::test_usb_link
