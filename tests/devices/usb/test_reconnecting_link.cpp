// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <optional>

#include <catch2/catch.hpp>

#include "devices/links/reconnecting_link.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/devices/usb/mock_device.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_reconnecting_link {

using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Contains;

namespace {

TimePoint now() {
  return std::chrono::steady_clock::now();
}

DeviceProfile profile_for(Transport transport) {
  DeviceProfile profile = reference_profile();
  profile.name = "reference";
  profile.transport = transport;
  profile.match.usb = {{0x1209, 0x6d0f}};
  return profile;
}

LinkSettings patient() {
  return {.write_deadline = 1h, .close_timeout = 10s};
}

std::string rejection(ReconnectingLink& link) {
  try {
    link.open();
  } catch (const DeviceNotFound& missing) {
    std::string text = missing.what();
    for (const std::string& seen : missing.rejected_devices()) text += "\n" + seen;
    return text;
  }
  return {};
}

}  // namespace

TEST_CASE("a link finds its device and is disconnected with it", "[usb]") {
  MockMachine machine;
  ReconnectingLink link(profile_for(Transport::hidraw), {}, patient());
  CHECK(rejection(link) == "no device of profile reference is connected");
  std::array<std::uint8_t, 64> buffer{};
  CHECK(link.read(now(), buffer).status == LinkStatus::disconnected);
  CHECK(link.write(now(), buffer) == LinkStatus::disconnected);

  std::optional<MockHidraw> mock(std::in_place, machine, MockIdentity{});
  link.open();
  CHECK(link.device()->serial == "A1");
  mock->send(Bytes(64, 1));
  link.wait_readable(now() + 1h);
  CHECK(link.read(now(), buffer).status == LinkStatus::ok);
  mock->unplug();
  while (link.read(now(), buffer).status != LinkStatus::disconnected) std::this_thread::yield();
  mock.reset();
  CHECK_THAT(rejection(link), Contains("no device of profile reference"));
}

TEST_CASE("a device in another USB port is the same device", "[usb]") {
  MockMachine machine;
  std::optional<MockHidraw> mock(std::in_place, machine, MockIdentity{.place = "1-1", .number = 0});
  ReconnectingLink link(profile_for(Transport::hidraw), {}, patient());
  link.open();
  mock->unplug();
  link.close();
  mock.reset();
  mock.emplace(machine, MockIdentity{.place = "2-1.4", .number = 5});
  link.open();
  CHECK(link.device()->port_path == "2-1.4");
  CHECK(link.write(now(), Bytes(32, 7)) == LinkStatus::ok);
  CHECK(mock->receive(32) == Bytes(32, 7));
}

TEST_CASE("another device in the same port is not opened, and nothing is written to it", "[usb]") {
  MockMachine machine;
  std::optional<MockHidraw> mock(std::in_place, machine, MockIdentity{.serial = "A1"});
  ReconnectingLink link(profile_for(Transport::hidraw), {}, patient());
  link.open();
  mock->unplug();
  link.close();
  mock.reset();
  mock.emplace(machine, MockIdentity{.serial = "B2"});
  CHECK_THAT(rejection(link), Contains("serial B2") && Contains("not the device that was unplugged"));
  CHECK(link.write(now(), Bytes(32, 7)) == LinkStatus::disconnected);
  CHECK_FALSE(mock->anything_received());
}

TEST_CASE("the serial number selects one of two equal devices", "[usb]") {
  MockMachine machine;
  MockHidraw first(machine, {.place = "1-1", .number = 0, .serial = "A1"});
  MockHidraw second(machine, {.place = "1-2", .number = 1, .serial = "B2"});
  ReconnectingLink either(profile_for(Transport::hidraw), {}, patient());
  CHECK_THAT(rejection(either), Contains("serial number A1") && Contains("serial number B2"));
  ReconnectingLink link(profile_for(Transport::hidraw), "B2", patient());
  link.open();
  CHECK(link.write(now(), Bytes(32, 7)) == LinkStatus::ok);
  CHECK(second.receive(32) == Bytes(32, 7));
  CHECK_FALSE(first.anything_received());
}

TEST_CASE("the USB port selects one of two devices without serial numbers", "[usb]") {
  MockMachine machine;
  MockHidraw first(machine, {.place = "1-1", .number = 0, .serial = ""});
  MockHidraw second(machine, {.place = "1-2", .number = 1, .serial = ""});
  ReconnectingLink link(profile_for(Transport::hidraw), {}, patient(), "1-2");
  link.open();
  CHECK(link.device()->port_path == "1-2");
  CHECK(link.write(now(), Bytes(32, 7)) == LinkStatus::ok);
  CHECK(second.receive(32) == Bytes(32, 7));
  CHECK_FALSE(first.anything_received());
  ReconnectingLink absent(profile_for(Transport::hidraw), {}, patient(), "1-3");
  CHECK_THAT(rejection(absent),
             Contains("in USB port 1-3") && Contains("requires the USB port 1-3, it is in 1-2"));
}

TEST_CASE("the profile selects the transport", "[usb]") {
  MockMachine machine;
  MockUsb mock(machine, {.hid = false});
  ReconnectingLink link(profile_for(Transport::libusb), {}, patient());
  link.open();
  CHECK(mock.claimed());
  mock.send(Bytes(64, 3));
  std::array<std::uint8_t, 64> buffer{};
  link.wait_readable(now() + 1h);
  CHECK(link.read(now(), buffer).status == LinkStatus::ok);
  CHECK(buffer[63] == 3);
  link.close();
  CHECK_FALSE(mock.claimed());
}

TEST_CASE("reading and writing over a reconnecting link does not allocate", "[usb]") {
  MockMachine machine;
  MockHidraw mock(machine, {});
  ReconnectingLink link(profile_for(Transport::hidraw), {}, patient());
  link.open();
  mock.send(Bytes(64, 1));
  std::array<std::uint8_t, 64> buffer{};
  const std::array<std::uint8_t, 32> command{};
  const RealtimeGuard guard;
  link.wait_readable(now() + 1h);
  link.read(now(), buffer);
  link.write(now(), command);
  CHECK(guard.allocations() == 0);
}

}  // namespace wrenchd::test_reconnecting_link
