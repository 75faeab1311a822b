// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <numeric>
#include <thread>

#include <catch2/catch.hpp>

#include "devices/links/hidraw_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/devices/usb/mock_device.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_hidraw_link {

using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Contains;

namespace {

TimePoint now() {
  return std::chrono::steady_clock::now();
}

/// A mock device and an open link to it.
struct Bench {
  MockMachine machine;
  MockHidraw mock;
  HidrawLink link;

  explicit Bench(const MockIdentity& identity = {})
      : mock(machine, identity), link(list_usb_devices().at(0), {.close_timeout = 1h}) {
    link.open();
  }
};

Bytes numbered(std::size_t length, std::uint8_t first) {
  Bytes bytes(length);
  std::iota(bytes.begin(), bytes.end(), first);
  return bytes;
}

/// Waits for the next report of the link and returns it.
std::pair<LinkRead, Bytes> read_one(ReportLink& link, std::size_t room = 64) {
  Bytes buffer(room);
  link.wait_readable(now() + 1h);
  const LinkRead read = link.read(now(), buffer);
  buffer.resize(std::min(read.length, room));
  return {read, buffer};
}

}  // namespace

TEST_CASE("hidraw: a read without a report returns at once", "[usb]") {
  Bench bench;
  std::array<std::uint8_t, 64> buffer{};
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
  bench.link.wait_readable(now() - 1s);
  bench.link.wait_readable(now() + 1ms);
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
}

TEST_CASE("hidraw: a report of any length is read unchanged", "[usb]") {
  Bench bench;
  for (const std::size_t length : {1U, 7U, 32U, 63U, 64U}) {
    const Bytes report = numbered(length, 1);
    bench.mock.send(report);
    const auto [read, bytes] = read_one(bench.link);
    CHECK(read.status == LinkStatus::ok);
    CHECK(read.length == length);
    CHECK(bytes == report);
  }
}

TEST_CASE("hidraw: a report longer than the buffer is truncated, and its length is returned", "[usb]") {
  Bench bench;
  bench.mock.send(numbered(200, 1));
  const auto [read, bytes] = read_one(bench.link);
  CHECK(read.length == 200);
  CHECK(bytes == numbered(64, 1));
  std::array<std::uint8_t, 64> buffer{};
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::not_ready);
}

TEST_CASE("hidraw: a report is written with its id first if the device has ids", "[usb]") {
  Bench bench;
  Bytes report = numbered(32, 2);
  CHECK(bench.link.write(now(), report) == LinkStatus::ok);
  CHECK(bench.mock.receive(32) == report);
  CHECK_FALSE(bench.mock.anything_received());
}

TEST_CASE("hidraw: without ids a zero is added in front on writing, and nothing is removed on reading",
          "[usb]") {
  Bench bench({.numbered_reports = false});
  const Bytes report = numbered(32, 9);
  CHECK(bench.link.write(now(), report) == LinkStatus::ok);
  Bytes framed{0};
  framed.insert(framed.end(), report.begin(), report.end());
  CHECK(bench.mock.receive(33) == framed);
  bench.mock.send(numbered(64, 7));
  CHECK(read_one(bench.link).second == numbered(64, 7));
}

// The kernel may take a part of a report. The device then has not got it.
TEST_CASE("hidraw: a short write is a failed write", "[usb]") {
  CHECK(write_status(33, 33, 0) == LinkStatus::ok);
  CHECK(write_status(32, 33, 0) == LinkStatus::not_ready);
  CHECK(write_status(0, 33, 0) == LinkStatus::not_ready);
  CHECK(write_status(-1, 33, ETIMEDOUT) == LinkStatus::not_ready);
  CHECK(write_status(-1, 33, ENODEV) == LinkStatus::disconnected);
  CHECK(write_status(-1, 33, EIO) == LinkStatus::disconnected);
}

TEST_CASE("hidraw: the last submitted report is written before the link closes", "[usb]") {
  Bench bench;
  for (int i = 0; i < 50; ++i) bench.link.write(now(), numbered(32, 2));
  bench.link.write(now(), Bytes(32, 0));
  const std::uint64_t replaced_at_most = 50;
  bench.link.close();
  Bytes last;
  std::uint64_t written = 0;
  for (; bench.mock.anything_received(); ++written) last = bench.mock.receive(32);
  CHECK(last == Bytes(32, 0));
  CHECK(written >= 1);
  CHECK(written <= replaced_at_most + 1);
  CHECK(bench.link.write(now(), numbered(32, 2)) == LinkStatus::disconnected);
}

TEST_CASE("hidraw: an unplugged device is disconnected at once and stays disconnected", "[usb]") {
  Bench bench;
  bench.mock.unplug();
  std::array<std::uint8_t, 64> buffer{};
  bench.link.wait_readable(now() + 1h);
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::disconnected);
  CHECK(bench.link.read(now(), buffer).status == LinkStatus::disconnected);
  CHECK(bench.link.write(now(), numbered(32, 2)) == LinkStatus::disconnected);
  bench.link.wait_readable(now() + 1h);
  bench.link.close();
  bench.link.close();
  CHECK_THROWS_WITH(bench.link.open(), Contains("no longer connected"));
}

TEST_CASE("hidraw: unplugging is detected without allocation", "[usb][realtime]") {
  Bench bench;
  std::array<std::uint8_t, 64> buffer{};
  bench.mock.unplug();
  std::uint64_t allocations = 0;
  LinkRead read;
  {
    const RealtimeGuard guard;
    read = bench.link.read(TimePoint{1h}, buffer);
    allocations = guard.allocations();
  }
  CHECK(read.status == LinkStatus::disconnected);
  CHECK(allocations == 0);
}

TEST_CASE("hidraw: another device behind the same node is rejected, and nothing is written to it", "[usb]") {
  MockMachine machine;
  MockIdentity identity{.serial = "MINE"};
  auto mock = std::make_unique<MockHidraw>(machine, identity);
  HidrawLink link(list_usb_devices().at(0));
  mock.reset();
  SECTION("another serial number") {
    identity.serial = "YOURS";
  }
  SECTION("another product") {
    identity.product = "0001";
  }
  SECTION("another descriptor") {
    identity.numbered_reports = false;
  }
  const MockHidraw other(machine, identity);
  CHECK_THROWS_WITH(link.open(), Contains("/dev/hidraw0") && Contains("nothing was written"));
  CHECK(link.write(now(), numbered(32, 2)) == LinkStatus::disconnected);
  CHECK_FALSE(other.anything_received());
}

TEST_CASE("hidraw: the same device can be opened again after reconnection", "[usb]") {
  MockMachine machine;
  auto mock = std::make_unique<MockHidraw>(machine, MockIdentity{});
  HidrawLink link(list_usb_devices().at(0));
  for (int i = 0; i < 3; ++i) {
    link.open();
    mock->send(numbered(64, 1));
    CHECK(read_one(link).first.status == LinkStatus::ok);
    mock->unplug();
    CHECK(read_one(link).first.status == LinkStatus::disconnected);
    mock = std::make_unique<MockHidraw>(machine, MockIdentity{});
  }
}

TEST_CASE("hidraw: two equal devices are read and written independently", "[usb]") {
  MockMachine machine;
  MockHidraw left(machine, {.place = "1-1", .number = 0, .serial = "L"});
  MockHidraw right(machine, {.place = "1-2", .number = 1, .serial = "R"});
  const auto found = list_usb_devices();
  REQUIRE(found.at(1).serial == "R");
  HidrawLink l(found.at(0)), r(found.at(1));
  r.open();
  l.open();
  left.send(numbered(64, 1));
  right.send(numbered(64, 101));
  CHECK(read_one(r).second == numbered(64, 101));
  CHECK(read_one(l).second == numbered(64, 1));
  l.write(now(), Bytes(32, 3));
  r.write(now(), Bytes(32, 4));
  CHECK(right.receive(32) == Bytes(32, 4));
  CHECK(left.receive(32) == Bytes(32, 3));
}

TEST_CASE("hidraw: a device without a node is rejected with the alternative", "[usb]") {
  UsbDevice device;
  device.port_path = "1-1";
  CHECK_THROWS_WITH(HidrawLink(device).open(), Contains("1-1") && Contains("use libusb"));
}

TEST_CASE("hidraw: a profile device reads the pose, and the device receives the wrench", "[usb]") {
  Bench bench;
  DeviceProfile profile = reference_profile();
  profile.stale_fault_s = 3600.0;  // independent of the speed of the machine
  ProfileDevice device(profile, bench.link);
  device.open();
  device.read_newest(now());
  device.assume_trusted();
  PoseReport pose;
  pose.sequence = 7;
  pose.X_BH.translation_m = {0.01, 0.02, -0.03};
  Bytes report(64);
  encode(profile.pose_report, pose, report);
  bench.mock.send(report);
  device.wait_readable(now() + 1h);
  const DeviceSample sample = device.read_newest(now());
  CHECK(sample.fresh);
  CHECK(sample.fault == Fault::none);
  CHECK((sample.X_BH.translation_m - pose.X_BH.translation_m).norm() < 1e-9);
  CHECK(device.write(now(), {{1.0, -2.0, 0.5}, {}}, true) == Fault::none);
  const auto [outcome, wrench] = decode(profile.wrench_report, bench.mock.receive(32));
  CHECK(outcome == Decoding::ok);
  CHECK(wrench.enable);
  CHECK((wrench.F.force_N - Vector3d(1.0, -2.0, 0.5)).norm() < 1e-5);
}

TEST_CASE("hidraw: a device that another link has open is not opened", "[usb]") {
  Bench bench;
  HidrawLink second(bench.link.device());
  CHECK_THROWS_WITH(second.open(), Contains("another program uses it: end that program"));
  bench.link.close();
  CHECK_NOTHROW(second.open());
}

}  // namespace wrenchd::test_hidraw_link
