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

#include "devices/reference_layout.hpp"
#include "devices/report_codec.hpp"

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
  wrench.force.bits = 24;
  CHECK_THAT(refusal(wrench), Contains("force must be 8, 16 or 32 bits"));
  wrench = kWrench;
  wrench.torque.count = 2;
  CHECK_THAT(refusal(wrench), Contains("torque must hold 3 integers"));
  wrench = kWrench;
  wrench.force.step = 0.0;
  CHECK_THAT(refusal(wrench), Contains("force needs a finite step"));
}
