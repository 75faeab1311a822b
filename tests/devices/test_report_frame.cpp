// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/report_frame.hpp"
#include "tests/support/report_round_trip.hpp"

namespace wrenchd::test_report_frame {

TEST_CASE("CRC-16/CCITT-FALSE has its published check value") {
  const std::string digits = "123456789";
  const std::vector<std::uint8_t> bytes(digits.begin(), digits.end());
  CHECK(crc16_ccitt_false(bytes) == 0x29B1);
  CHECK(crc16_ccitt_false({}) == 0xFFFF);
}

TEST_CASE("a report with one wrong bit is rejected") {
  ReportBuffer good;
  PoseReport report;
  report.sequence = 77;
  encode(kPose, report, good);
  for (std::size_t bit = 0; bit < 8 * kPose.length; ++bit) {
    ReportBuffer bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
    REQUIRE(decode(kPose, bad).outcome == (bit < 8 ? Decoding::wrong_id : Decoding::bad_checksum));
  }
  for (std::size_t length = 0; length < kPose.length; ++length)
    REQUIRE(decode(kPose, std::span(good).first(length)).outcome == Decoding::wrong_length);
  CHECK(decode(kWrench, good).outcome == Decoding::wrong_length);
}

TEST_CASE("each checksum, at any position, detects one wrong bit") {
  for (const Checksum checksum : {Checksum::crc16_ccitt_false, Checksum::sum8, Checksum::xor8}) {
    for (const bool at_end : {true, false}) {
      WrenchReportLayout layout = layout_with_force(16, true, 1.0);
      layout.checksum = checksum;
      layout.checksum_from = 1;
      if (!at_end) layout.checksum_at = 29;
      CHECK(validation_error(layout).empty());
      WrenchReport report;
      report.F.force_N = {1, 2, -3};
      ReportBuffer good;
      encode(layout, report, good);
      const std::size_t end = at_end ? 32 : (checksum == Checksum::crc16_ccitt_false ? 31 : 30);
      for (std::size_t bit = 8; bit < 8 * end; ++bit) {
        ReportBuffer bad = good;
        bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
        REQUIRE(decode(layout, std::span(bad).first(32)).outcome == Decoding::bad_checksum);
      }
    }
  }
  WrenchReportLayout layout = layout_with_force(8, true, 1.0);
  layout.checksum = Checksum::sum8;
  WrenchReport report;
  report.F.force_N = {1, 2, -1};
  ReportBuffer bytes;
  encode(layout, report, bytes);
  CHECK(bytes[31] == ((7 + 1 + 2 + 255) & 0xff));
  layout.checksum = Checksum::xor8;
  encode(layout, report, bytes);
  CHECK(bytes[31] == (7 ^ 1 ^ 2 ^ 255));
}

TEST_CASE("constants must match, and the template fills bytes without a field") {
  WrenchReportLayout layout = layout_with_force(8, true, 1.0);
  layout.has_id = false;
  layout.constants = {{0, 0x3c}, {31, 0x3e}};
  layout.template_bytes.assign(32, 0x55);
  CHECK(validation_error(layout).empty());
  ReportBuffer bytes;
  encode(layout, WrenchReport{}, bytes);
  CHECK(bytes[0] == 0x3c);
  CHECK(bytes[1] == 0);
  CHECK(bytes[4] == 0x55);
  CHECK(bytes[31] == 0x3e);
  CHECK(decode(layout, std::span(bytes).first(32)).outcome == Decoding::ok);
  bytes[31] = 0;
  CHECK(decode(layout, std::span(bytes).first(32)).outcome == Decoding::wrong_marker);
}

TEST_CASE("a report may be as short as its minimum length, and no shorter") {
  PoseReportLayout layout;
  layout.id = 3;
  layout.length = 5;
  layout.min_length = 3;
  layout.buttons = {.present = true, .byte = 1, .bits = 32};
  const std::array<std::uint8_t, 6> bytes = {3, 0x81, 0x02, 0x04, 0x80, 0xff};
  CHECK(decode(layout, std::span(bytes).first(5)).report.buttons == 0x80040281u);
  CHECK(decode(layout, std::span(bytes).first(3)).report.buttons == 0x0281u);
  CHECK(decode(layout, std::span(bytes).first(2)).outcome == Decoding::wrong_length);
  CHECK(decode(layout, std::span(bytes)).outcome == Decoding::wrong_length);
}

}  // namespace wrenchd::test_report_frame
