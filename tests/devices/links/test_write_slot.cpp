// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdint>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/links/write_slot.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_write_slot {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

std::array<std::uint8_t, 3> report(int n) {
  return {0x02, static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(n >> 8)};
}

int number_in(const Packet& packet) {
  return packet.bytes[1] + 256 * packet.bytes[2];
}

const TimePoint kStart{1h};

}  // namespace

TEST_CASE("the newest report replaces the previous one, which is counted", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  CHECK_FALSE(slot.take(packet));
  for (int n = 1; n <= 5; ++n) CHECK(slot.submit(kStart, report(n)) == LinkStatus::ok);
  REQUIRE(slot.take(packet));
  CHECK(number_in(packet) == 5);
  CHECK(packet.length == 3);
  CHECK(slot.replaced() == 4);
  CHECK_FALSE(slot.take(packet));
  slot.complete(LinkStatus::ok);
  CHECK(slot.written() == 1);
}

TEST_CASE("an endless write is reported after the deadline, independent of further submissions", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  slot.submit(kStart, report(0));
  REQUIRE(slot.take(packet));
  for (int n = 1; n <= 10; ++n)
    CHECK(slot.submit(kStart + n * 1ms, report(n)) == (n > 4 ? LinkStatus::not_ready : LinkStatus::ok));
  CHECK(slot.overdue(kStart + 11ms));

  slot.complete(LinkStatus::ok);  // the stuck write ends; the newest report is next
  CHECK(slot.submit(kStart + 12ms, report(12)) == LinkStatus::ok);
  REQUIRE(slot.take(packet));
  CHECK(number_in(packet) == 12);
  CHECK(slot.replaced() == 10);
}

TEST_CASE("a writer that never takes a report is overdue", "[usb]") {
  WriteSlot slot(4ms);
  CHECK_FALSE(slot.overdue(kStart + 1h));
  slot.submit(kStart, report(1));
  CHECK_FALSE(slot.overdue(kStart + 4ms));
  CHECK(slot.overdue(kStart + 4ms + 1ns));
}

TEST_CASE("a slow writer that makes progress is not overdue", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  for (int n = 0; n < 1000; ++n) {
    REQUIRE(slot.submit(kStart + n * 1ms, report(n)) == LinkStatus::ok);
    if (n % 3 != 0) continue;
    if (n > 0) slot.complete(LinkStatus::ok);
    REQUIRE(slot.take(packet));
    REQUIRE(number_in(packet) == n);
  }
}

TEST_CASE("a pause between two commands does not make the writer overdue", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  slot.submit(kStart, report(1));
  slot.take(packet);
  slot.complete(LinkStatus::ok);
  CHECK(slot.submit(kStart + 1h, report(2)) == LinkStatus::ok);
}

TEST_CASE("a failed write is reported once, with the next report", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  slot.submit(kStart, report(1));
  slot.take(packet);
  slot.complete(LinkStatus::not_ready);
  CHECK(slot.failed() == 1);
  CHECK(slot.submit(kStart + 1ms, report(2)) == LinkStatus::not_ready);
  CHECK(slot.submit(kStart + 2ms, report(3)) == LinkStatus::ok);
  REQUIRE(slot.take(packet));
  CHECK(number_in(packet) == 3);
}

TEST_CASE("after disconnection no report is accepted", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  slot.submit(kStart, report(1));
  slot.take(packet);
  slot.complete(LinkStatus::disconnected);
  CHECK(slot.submit(kStart + 1ms, report(2)) == LinkStatus::disconnected);
  CHECK_FALSE(slot.take(packet));
}

TEST_CASE("a report that is too long is rejected and the previous one stays", "[usb]") {
  WriteSlot slot(4ms);
  Packet packet;
  slot.submit(kStart, report(1));
  CHECK(slot.submit(kStart, std::vector<std::uint8_t>(kMaxReportBytes + 1)) == LinkStatus::not_ready);
  REQUIRE(slot.take(packet));
  CHECK(number_in(packet) == 1);
}

TEST_CASE("submitting and taking do not allocate or lock", "[usb][realtime]") {
  WriteSlot slot(4ms);
  Packet packet;
  std::uint64_t seen = 0;
  {
    const RealtimeGuard guard;
    for (int n = 0; n < 1000; ++n) {
      slot.submit(kStart + n * 1ms, report(n));
      slot.submit(kStart + n * 1ms, report(n));
      slot.take(packet);
      slot.complete(n % 7 == 0 ? LinkStatus::not_ready : LinkStatus::ok);
    }
    seen = guard.allocations() + guard.locks();
  }
  CHECK(seen == 0);
}

}  // namespace wrenchd::test_write_slot
