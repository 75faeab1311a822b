// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <span>

#include <catch2/catch.hpp>

#include "devices/report_bits.hpp"
#include "tests/support/report_round_trip.hpp"

namespace wrenchd::test_report_bits {

TEST_CASE("integers of every width are little-endian two's complement and clamp at their range") {
  struct Width {
    unsigned bits;
    bool is_signed;
    double lowest, highest;
  };
  for (const Width w : {Width{8, true, -128, 127}, Width{16, true, -32768, 32767},
                        Width{32, true, -2147483648.0, 2147483647.0}, Width{8, false, 0, 255},
                        Width{16, false, 0, 65535}, Width{32, false, 0, 4294967295.0}}) {
    const double step = 0.25;
    const WrenchReportLayout layout = layout_with_force(w.bits, w.is_signed, step);
    CAPTURE(w.bits, w.is_signed);
    const Vector3d ends = force_round_trip(layout, {-1e300, 1e300, w.lowest * step});
    CHECK(ends == Vector3d(w.lowest * step, w.highest * step, w.lowest * step));
    CHECK(force_round_trip(layout, {w.highest * step, (w.highest + 0.4) * step, (w.highest + 7) * step}) ==
          Vector3d::Constant(w.highest * step));
    CHECK(force_round_trip(layout, {3 * step, 3.4 * step, 2.5 * step}) == Vector3d::Constant(3 * step));
  }
  ReportBuffer bytes;
  WrenchReport report;
  report.F.force_N = {-2.0, 258.0, 0.0};
  encode(layout_with_force(16, true, 1.0), report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 6)) == "fe ff 02 01 00 00");
}

TEST_CASE("a value that is not finite is encoded as zero") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  CHECK(force_round_trip(kWrench, {nan, inf, -inf}) == Vector3d::Zero());
}

TEST_CASE("a field of any width at any bit survives encoding and decoding and changes no other bit") {
  std::mt19937_64 random(11);
  for (unsigned bits = 1; bits <= 64; ++bits) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      for (const bool is_signed : {false, true}) {
        const ReportField field = {
            .present = true, .byte = 3, .bits = bits, .is_signed = is_signed, .count = 3, .bit = bit};
        PoseReportLayout layout;
        layout.has_id = false;
        layout.length = 40;
        layout.joints = field;
        ReportBuffer bytes;
        PoseReport report;
        std::array<std::uint64_t, 3> raw{};
        for (std::size_t i = 0; i < 3; ++i) {
          raw[i] = random() >> (64 - std::min(bits, 53u));  // a double has 53 bits
          report.joints[i] = static_cast<double>(raw[i]);
          if (!is_signed || bits < 2) continue;
          raw[i] >>= 1;
          report.joints[i] = i == 1 ? -static_cast<double>(raw[i]) : static_cast<double>(raw[i]);
        }
        if (bits == 1 && is_signed) continue;  // its values are 0 and -1
        encode(layout, report, bytes);
        const auto decoded = decode(layout, std::span(bytes).first(40));
        REQUIRE(decoded.outcome == Decoding::ok);
        for (std::size_t i = 0; i < 3; ++i) REQUIRE(decoded.report.joints[i] == report.joints[i]);
        const std::size_t first = 24 + bit, last = first + 3 * bits;
        for (std::size_t i = 0; i < 320; ++i)
          if (i < first || i >= last) REQUIRE((bytes[i / 8] >> (i % 8) & 1) == 0);
      }
    }
  }
}

TEST_CASE("the bits of a field have the positions that HID defines") {
  WrenchReportLayout layout = layout_with_force(12, true, 1.0);  // 1 + 1.5 * 3 bytes
  WrenchReport report;
  report.F.force_N = {0x123, -1, 0x456};
  ReportBuffer bytes;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 5)) == "23 f1 ff 56 04");
  layout.force.bits = 16;
  layout.force.big_endian = true;
  report.F.force_N = {0x0123, -2, 0x4567};
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 6)) == "01 23 ff fe 45 67");
  CHECK(force_round_trip(layout, report.F.force_N) == report.F.force_N);
}

TEST_CASE("values of every width, also 64 bits, clamp at their range") {
  const double huge = 1e300;
  for (unsigned bits = 1; bits <= 64; ++bits) {
    PoseReportLayout layout;
    layout.has_id = false;
    layout.length = 24;
    layout.joints = {.present = true, .byte = 0, .bits = bits, .is_signed = true, .count = 3};
    ReportBuffer bytes;
    PoseReport report;
    report.joints = {huge, -huge, std::numeric_limits<double>::quiet_NaN()};
    encode(layout, report, bytes);
    const std::uint64_t top = (bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1) >> 1;
    CAPTURE(bits);
    CHECK(raw_integer(layout.joints, bytes, 0) == top);
    CHECK(raw_integer(layout.joints, bytes, 1) == ~top);
    CHECK(raw_integer(layout.joints, bytes, 2) == 0);
    layout.joints.is_signed = false;
    encode(layout, report, bytes);
    CHECK(raw_integer(layout.joints, bytes, 0) ==
          (bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1));
    CHECK(raw_integer(layout.joints, bytes, 1) == 0);
  }
}

TEST_CASE("nibbles are characters from A on, in either byte order") {
  WrenchReportLayout layout = layout_with_force(16, true, 1.0);
  layout.force.coding = Coding::nibble_ascii;
  layout.force.base = 0x41;
  layout.torque.present = false;
  WrenchReport report;
  report.F.force_N = {0x05a7, -1, 0};
  ReportBuffer bytes;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 12)) == "48 4b 46 41 50 50 50 50 41 41 41 41");
  CHECK(force_round_trip(layout, {-4096, 4096, 77}) == Vector3d(-4096, 4096, 77));
  layout.force.big_endian = true;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 4)) == "41 46 4b 48");
}

TEST_CASE("a field has an offset and a signed step") {
  WrenchReportLayout layout = layout_with_force(8, false, -0.5);
  layout.force.offset = 10.0;
  CHECK(force_round_trip(layout, {10.0, 9.5, -117.5}) == Vector3d(10.0, 9.5, -117.5));
  CHECK(force_round_trip(layout, {11.0, -200.0, 0.0}) == Vector3d(10.0, -117.5, 0.0));
}

}  // namespace wrenchd::test_report_bits
