// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "devices/report_codec.hpp"
#include "devices/simulation/reference_profile.hpp"

using namespace wrenchd;

namespace {

using Buffer = std::array<std::uint8_t, kMaxReportBytes>;

const PoseReportLayout kPose = reference_profile().pose_report;
const WrenchReportLayout kWrench = reference_profile().wrench_report;

template <class Layout, class Report>
Report there_and_back(const Layout& layout, const Report& report) {
  Buffer bytes;
  REQUIRE(encode(layout, report, bytes) == layout.length);
  const auto decoded = decode(layout, std::span(bytes).first(layout.length));
  REQUIRE(decoded.outcome == Decoding::ok);
  return decoded.report;
}

/// A layout with room for anything, to try fields of other widths.
WrenchReportLayout layout_with_force(unsigned bits, bool is_signed, double step) {
  WrenchReportLayout layout;
  layout.id = 7;
  layout.length = 32;
  layout.force = {.present = true, .byte = 1, .bits = bits, .is_signed = is_signed, .step = step, .count = 3};
  layout.torque = {.present = true, .byte = 16, .bits = 32, .is_signed = true, .step = 1e-6, .count = 3};
  return layout;
}

Vector3d force_there_and_back(const WrenchReportLayout& layout, const Vector3d& force_N) {
  WrenchReport report;
  report.F.force_N = force_N;
  return there_and_back(layout, report).F.force_N;
}

std::string hex(std::span<const std::uint8_t> bytes) {
  std::ostringstream out;
  for (const unsigned byte : bytes) out << std::hex << std::setw(2) << std::setfill('0') << byte << ' ';
  std::string text = out.str();
  text.pop_back();
  return text;
}

/// devices/README.md with its line breaks and indents read as single blanks.
std::string readme() {
  std::ifstream file(std::filesystem::path(WRENCHD_SOURCE_DIR) / "devices/README.md");
  std::string text, word;
  while (file >> word) text += word + ' ';
  return text;
}

template <class Layout>
std::string refusal(const Layout& layout) {
  try {
    check(layout);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("CRC-16/CCITT-FALSE has its published check value") {
  const std::string digits = "123456789";
  const std::vector<std::uint8_t> bytes(digits.begin(), digits.end());
  CHECK(crc16_ccitt_false(bytes) == 0x29B1);
  CHECK(crc16_ccitt_false({}) == 0xFFFF);
}

TEST_CASE("the worked examples of devices/README.md are what the codec makes") {
  Buffer bytes;
  PoseReport pose;
  pose.X_BH.translation_m = {0.1, -0.05, 0.2};
  pose.X_BH.rotation = Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitZ()));
  pose.V_BH = {{0.25, 0.0, -0.5}, {0.0, 0.0, 1.5}};
  pose.sequence = 513;
  pose.device_time = 1'000'000;
  pose.acknowledged = 200;
  pose.buttons = 1;
  pose.motors_on = true;
  encode(kPose, pose, bytes);
  const std::string pose_hex = hex(std::span(bytes).first(kPose.length));
  INFO(pose_hex);
  CHECK(readme().find(pose_hex) != std::string::npos);

  WrenchReport wrench;
  wrench.F = {{1.0, -2.5, 0.0}, {0.0, 0.05, -0.1}};
  wrench.hold_time_s = 0.008;
  wrench.sequence = 200;
  wrench.enable = true;
  encode(kWrench, wrench, bytes);
  const std::string wrench_hex = hex(std::span(bytes).first(kWrench.length));
  INFO(wrench_hex);
  CHECK(readme().find(wrench_hex) != std::string::npos);
}

TEST_CASE("a pose report comes back to half a count, its counters to the bit") {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::uniform_int_distribution<std::uint32_t> any;
  const auto vector = [&](double size) {
    return Vector3d(size * unit(random), size * unit(random), size * unit(random));
  };
  for (int i = 0; i < 5000; ++i) {
    PoseReport sent;
    sent.X_BH.rotation = Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized();
    sent.X_BH.translation_m = vector(std::pow(10.0, 2.3 * unit(random)));
    sent.V_BH = {vector(2.0), vector(20.0)};
    sent.sequence = any(random) & 0xffff;
    sent.device_time = any(random);
    sent.acknowledged = any(random) & 0xff;
    sent.buttons = any(random) & 0xff;
    sent.motors_on = unit(random) > 0;
    sent.watchdog_tripped = unit(random) > 0;

    const PoseReport back = there_and_back(kPose, sent);
    const auto distance = [](const auto& a, const auto& b) { return (a - b).cwiseAbs().maxCoeff(); };
    const double half = 0.5 + 1e-6;  // counts, and rounding of the products
    REQUIRE(distance(back.X_BH.translation_m, sent.X_BH.translation_m) <= half * 1e-7);
    REQUIRE(distance(back.X_BH.rotation.coeffs(), sent.X_BH.rotation.coeffs()) <= half * 0x1p-30);
    REQUIRE(distance(back.V_BH.linear_m_per_s, sent.V_BH.linear_m_per_s) <= half * 1e-6);
    REQUIRE(distance(back.V_BH.angular_rad_per_s, sent.V_BH.angular_rad_per_s) <= half * 1e-6);
    REQUIRE(back.sequence == sent.sequence);
    REQUIRE(back.device_time == sent.device_time);
    REQUIRE(back.acknowledged == sent.acknowledged);
    REQUIRE(back.buttons == sent.buttons);
    REQUIRE(back.motors_on == sent.motors_on);
    REQUIRE(back.watchdog_tripped == sent.watchdog_tripped);
  }
}

TEST_CASE("a wrench report comes back to half a count") {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (std::uint32_t i = 0; i < 5000; ++i) {
    WrenchReport sent;
    sent.F = {{10 * unit(random), 10 * unit(random), 10 * unit(random)},
              {unit(random), unit(random), unit(random)}};
    sent.hold_time_s = 0.001 * (i % 33);
    sent.sequence = i;
    sent.enable = i % 3 == 0;
    const WrenchReport back = there_and_back(kWrench, sent);
    REQUIRE((back.F.force_N - sent.F.force_N).cwiseAbs().maxCoeff() <= 0.500001e-6);
    REQUIRE((back.F.torque_Nm - sent.F.torque_Nm).cwiseAbs().maxCoeff() <= 0.500001e-6);
    REQUIRE(back.hold_time_s == Approx(sent.hold_time_s).margin(1e-15));
    REQUIRE(back.sequence == sent.sequence);
    REQUIRE(back.enable == sent.enable);
  }
}

TEST_CASE("every width is two's complement, little-endian, and saturates at its ends") {
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
    const Vector3d ends = force_there_and_back(layout, {-1e300, 1e300, w.lowest * step});
    CHECK(ends == Vector3d(w.lowest * step, w.highest * step, w.lowest * step));
    CHECK(force_there_and_back(layout, {w.highest * step, (w.highest + 0.4) * step,
                                        (w.highest + 7) * step}) == Vector3d::Constant(w.highest * step));
    CHECK(force_there_and_back(layout, {3 * step, 3.4 * step, 2.5 * step}) == Vector3d::Constant(3 * step));
  }
  Buffer bytes;
  WrenchReport report;
  report.F.force_N = {-2.0, 258.0, 0.0};
  encode(layout_with_force(16, true, 1.0), report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 6)) == "fe ff 02 01 00 00");
}

TEST_CASE("a value that is not finite is sent as zero, never as full scale") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  CHECK(force_there_and_back(kWrench, {nan, inf, -inf}) == Vector3d::Zero());
}

TEST_CASE("a report with any one bit wrong is refused") {
  Buffer good;
  PoseReport report;
  report.sequence = 77;
  encode(kPose, report, good);
  for (std::size_t bit = 0; bit < 8 * kPose.length; ++bit) {
    Buffer bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
    REQUIRE(decode(kPose, bad).outcome == (bit < 8 ? Decoding::wrong_id : Decoding::bad_checksum));
  }
  for (std::size_t length = 0; length < kPose.length; ++length)
    REQUIRE(decode(kPose, std::span(good).first(length)).outcome == Decoding::wrong_length);
  CHECK(decode(kWrench, good).outcome == Decoding::wrong_length);
}

TEST_CASE("a buffer that is too short is left alone") {
  Buffer bytes;
  bytes.fill(0xAA);
  CHECK(encode(kWrench, WrenchReport{}, std::span(bytes).first(31)) == 0);
  CHECK(bytes[0] == 0xAA);
}

TEST_CASE("what a layout leaves out reads as zero") {
  PoseReportLayout layout = kPose;
  layout.linear_velocity.present = layout.buttons.present = layout.motors_on.present = false;
  layout.checksum = Checksum::none;
  PoseReport report;
  report.V_BH.linear_m_per_s = {1, 2, 3};
  report.buttons = 3;
  report.motors_on = true;
  const PoseReport back = there_and_back(layout, report);
  CHECK(back.V_BH.linear_m_per_s == Vector3d::Zero());
  CHECK(back.buttons == 0);
  CHECK_FALSE(back.motors_on);
}

TEST_CASE("the reference layouts pass their own check") {
  CHECK(refusal(kPose).empty());
  CHECK(refusal(kWrench).empty());
}

TEST_CASE("a layout that cannot work is refused with the fields and the byte") {
  using Catch::Contains;
  PoseReportLayout pose = kPose;
  pose.orientation.byte = 19;
  CHECK_THAT(refusal(pose), Contains("orientation") && Contains("position") && Contains("byte 19"));
  pose = kPose;
  pose.watchdog_tripped.bit = 0;
  CHECK_THAT(refusal(pose), Contains("watchdog_tripped overlaps motors_on at byte 1"));
  pose.watchdog_tripped.bit = 8;
  CHECK_THAT(refusal(pose), Contains("bits 0 to 7"));
  pose = kPose;
  pose.buttons.byte = 0;
  CHECK_THAT(refusal(pose), Contains("buttons overlaps the report id"));
  pose = kPose;
  pose.acknowledged.byte = 62;
  CHECK_THAT(refusal(pose), Contains("acknowledged at byte 62 does not fit"));
  pose = kPose;
  pose.position.present = false;
  CHECK_THAT(refusal(pose), Contains("position is missing"));
  pose = kPose;
  pose.position.byte = std::numeric_limits<std::size_t>::max() / 8;
  CHECK_THAT(refusal(pose), Contains("does not fit"));

  WrenchReportLayout wrench = kWrench;
  wrench.length = 31;
  CHECK_THAT(refusal(wrench), Contains("hold_time at byte 28 does not fit"));
  wrench.length = 2;
  CHECK_THAT(refusal(wrench), Contains("length = 2"));
  wrench.length = 65;
  CHECK_THAT(refusal(wrench), Contains("length = 65"));
  wrench = kWrench;
  wrench.force.bits = 65;
  CHECK_THAT(refusal(wrench), Contains("force must be 1 to 64 bits"));
  wrench = kWrench;
  wrench.torque.count = 2;
  CHECK_THAT(refusal(wrench), Contains("torque must hold 3 integers"));
  wrench = kWrench;
  wrench.force.step = 0.0;
  CHECK_THAT(refusal(wrench), Contains("force needs a finite step"));
}

TEST_CASE("a field of any width at any bit comes back, and leaves its neighbours alone") {
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
        Buffer bytes;
        PoseReport report;
        std::array<std::uint64_t, 3> raw{};
        for (std::size_t i = 0; i < 3; ++i) {
          raw[i] = random() >> (64 - std::min(bits, 53u));  // a double holds no more than 53 bits
          report.joints[i] = static_cast<double>(raw[i]);
          if (!is_signed || bits < 2) continue;
          raw[i] >>= 1;
          report.joints[i] = i == 1 ? -static_cast<double>(raw[i]) : static_cast<double>(raw[i]);
        }
        if (bits == 1 && is_signed) continue;  // holds 0 and -1
        encode(layout, report, bytes);
        const auto back = decode(layout, std::span(bytes).first(40));
        REQUIRE(back.outcome == Decoding::ok);
        for (std::size_t i = 0; i < 3; ++i) REQUIRE(back.report.joints[i] == report.joints[i]);
        const std::size_t first = 24 + bit, last = first + 3 * bits;
        for (std::size_t i = 0; i < 320; ++i)
          if (i < first || i >= last) REQUIRE((bytes[i / 8] >> (i % 8) & 1) == 0);
      }
    }
  }
}

TEST_CASE("the bits of a field lie where HID puts them") {
  WrenchReportLayout layout = layout_with_force(12, true, 1.0);  // 1 + 1.5 * 3 bytes
  WrenchReport report;
  report.F.force_N = {0x123, -1, 0x456};
  Buffer bytes;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 5)) == "23 f1 ff 56 04");
  layout.force.bits = 16;
  layout.force.big_endian = true;
  report.F.force_N = {0x0123, -2, 0x4567};
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 6)) == "01 23 ff fe 45 67");
  CHECK(force_there_and_back(layout, report.F.force_N) == report.F.force_N);
}

TEST_CASE("every width saturates at its ends, 64 bits as well") {
  const double huge = 1e300;
  for (unsigned bits = 1; bits <= 64; ++bits) {
    PoseReportLayout layout;
    layout.has_id = false;
    layout.length = 24;
    layout.joints = {.present = true, .byte = 0, .bits = bits, .is_signed = true, .count = 3};
    Buffer bytes;
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

TEST_CASE("nibbles are characters from A on, the least significant first, or last") {
  WrenchReportLayout layout = layout_with_force(16, true, 1.0);
  layout.force.coding = Coding::nibble_ascii;
  layout.force.base = 0x41;
  layout.torque.present = false;
  WrenchReport report;
  report.F.force_N = {0x05a7, -1, 0};
  Buffer bytes;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 12)) == "48 4b 46 41 50 50 50 50 41 41 41 41");
  CHECK(force_there_and_back(layout, {-4096, 4096, 77}) == Vector3d(-4096, 4096, 77));
  layout.force.big_endian = true;
  encode(layout, report, bytes);
  CHECK(hex(std::span(bytes).subspan(1, 4)) == "41 46 4b 48");
}

TEST_CASE("a value has an offset and a sign") {
  WrenchReportLayout layout = layout_with_force(8, false, -0.5);
  layout.force.offset = 10.0;
  CHECK(force_there_and_back(layout, {10.0, 9.5, -117.5}) == Vector3d(10.0, 9.5, -117.5));
  CHECK(force_there_and_back(layout, {11.0, -200.0, 0.0}) == Vector3d(10.0, -117.5, 0.0));
}

TEST_CASE("each checksum, at the end or anywhere, finds any one wrong bit") {
  for (const Checksum checksum : {Checksum::crc16_ccitt_false, Checksum::sum8, Checksum::xor8}) {
    for (const bool at_end : {true, false}) {
      WrenchReportLayout layout = layout_with_force(16, true, 1.0);
      layout.checksum = checksum;
      layout.checksum_from = 1;
      if (!at_end) layout.checksum_at = 29;
      CHECK(refusal(layout).empty());
      WrenchReport report;
      report.F.force_N = {1, 2, -3};
      Buffer good;
      encode(layout, report, good);
      const std::size_t end = at_end ? 32 : (checksum == Checksum::crc16_ccitt_false ? 31 : 30);
      for (std::size_t bit = 8; bit < 8 * end; ++bit) {
        Buffer bad = good;
        bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1u << (bit % 8)));
        REQUIRE(decode(layout, std::span(bad).first(32)).outcome == Decoding::bad_checksum);
      }
    }
  }
  WrenchReportLayout layout = layout_with_force(8, true, 1.0);
  layout.checksum = Checksum::sum8;
  WrenchReport report;
  report.F.force_N = {1, 2, -1};
  Buffer bytes;
  encode(layout, report, bytes);
  CHECK(bytes[31] == ((7 + 1 + 2 + 255) & 0xff));
  layout.checksum = Checksum::xor8;
  encode(layout, report, bytes);
  CHECK(bytes[31] == (7 ^ 1 ^ 2 ^ 255));
}

TEST_CASE("markers must be there, a template is what stands between the fields") {
  WrenchReportLayout layout = layout_with_force(8, true, 1.0);
  layout.has_id = false;
  layout.constants = {{0, 0x3c}, {31, 0x3e}};
  layout.template_bytes.assign(32, 0x55);
  CHECK(refusal(layout).empty());
  Buffer bytes;
  encode(layout, WrenchReport{}, bytes);
  CHECK(bytes[0] == 0x3c);
  CHECK(bytes[1] == 0);
  CHECK(bytes[4] == 0x55);
  CHECK(bytes[31] == 0x3e);
  CHECK(decode(layout, std::span(bytes).first(32)).outcome == Decoding::ok);
  bytes[31] = 0;
  CHECK(decode(layout, std::span(bytes).first(32)).outcome == Decoding::wrong_marker);
}

TEST_CASE("a report that may be short lacks what it lacks, and no more") {
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

TEST_CASE("a pose may come in pieces") {
  PoseReportLayout position = kPose, orientation = kPose;
  position.orientation.present = false;
  orientation.position.present = false;
  PoseReport sent;
  sent.X_BH.translation_m = {0.1, 0.2, 0.3};
  sent.X_BH.rotation = Quaterniond(0.5, 0.5, 0.5, 0.5);
  Buffer bytes;
  PoseReport got;
  encode(position, sent, bytes);
  CHECK(decode_into(position, bytes, got) == Decoding::ok);
  CHECK(got.X_BH.rotation.isApprox(Quaterniond::Identity()));
  encode(orientation, sent, bytes);
  CHECK(decode_into(orientation, bytes, got) == Decoding::ok);
  CHECK(got.X_BH.translation_m.isApprox(sent.X_BH.translation_m, 1e-7));
  CHECK(got.X_BH.rotation.isApprox(sent.X_BH.rotation, 1e-8));
  const PoseReport before = got;
  bytes[20] ^= 1;
  CHECK(decode_into(orientation, bytes, got) == Decoding::bad_checksum);
  CHECK(got.X_BH.rotation.coeffs() == before.X_BH.rotation.coeffs());
}
