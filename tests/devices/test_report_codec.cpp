// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>

#include <catch2/catch.hpp>

#include "devices/report_codec.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/report_round_trip.hpp"

namespace wrenchd::test_report_codec {

namespace {

/// Returns devices/README.md with single blanks between words.
std::string readme() {
  std::ifstream file(test::source_path("devices/README.md"));
  std::string text, word;
  while (file >> word) text += word + ' ';
  return text;
}

}  // namespace

TEST_CASE("the codec gives the worked examples of devices/README.md") {
  ReportBuffer bytes;
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

TEST_CASE("a pose report survives encoding and decoding: values to half a count, counters exactly") {
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

    const PoseReport decoded = round_trip(kPose, sent);
    const auto distance = [](const auto& a, const auto& b) { return (a - b).cwiseAbs().maxCoeff(); };
    const double half = 0.5 + 1e-6;  // counts, plus rounding of the products
    REQUIRE(distance(decoded.X_BH.translation_m, sent.X_BH.translation_m) <= half * 1e-7);
    REQUIRE(distance(decoded.X_BH.rotation.coeffs(), sent.X_BH.rotation.coeffs()) <= half * 0x1p-30);
    REQUIRE(distance(decoded.V_BH.linear_m_per_s, sent.V_BH.linear_m_per_s) <= half * 1e-6);
    REQUIRE(distance(decoded.V_BH.angular_rad_per_s, sent.V_BH.angular_rad_per_s) <= half * 1e-6);
    REQUIRE(decoded.sequence == sent.sequence);
    REQUIRE(decoded.device_time == sent.device_time);
    REQUIRE(decoded.acknowledged == sent.acknowledged);
    REQUIRE(decoded.buttons == sent.buttons);
    REQUIRE(decoded.motors_on == sent.motors_on);
    REQUIRE(decoded.watchdog_tripped == sent.watchdog_tripped);
  }
}

TEST_CASE("a wrench report survives encoding and decoding to half a count") {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (std::uint32_t i = 0; i < 5000; ++i) {
    WrenchReport sent;
    sent.F = {{10 * unit(random), 10 * unit(random), 10 * unit(random)},
              {unit(random), unit(random), unit(random)}};
    sent.hold_time_s = 0.001 * (i % 33);
    sent.sequence = i;
    sent.enable = i % 3 == 0;
    const WrenchReport decoded = round_trip(kWrench, sent);
    REQUIRE((decoded.F.force_N - sent.F.force_N).cwiseAbs().maxCoeff() <= 0.500001e-6);
    REQUIRE((decoded.F.torque_Nm - sent.F.torque_Nm).cwiseAbs().maxCoeff() <= 0.500001e-6);
    REQUIRE(decoded.hold_time_s == Approx(sent.hold_time_s).margin(1e-15));
    REQUIRE(decoded.sequence == sent.sequence);
    REQUIRE(decoded.enable == sent.enable);
  }
}

TEST_CASE("encoding writes nothing to a buffer that is too short") {
  ReportBuffer bytes;
  bytes.fill(0xAA);
  CHECK(encode(kWrench, WrenchReport{}, std::span(bytes).first(31)) == 0);
  CHECK(bytes[0] == 0xAA);
}

TEST_CASE("fields that a layout does not have decode to zero") {
  PoseReportLayout layout = kPose;
  layout.linear_velocity.present = layout.buttons.present = layout.motors_on.present = false;
  layout.checksum = Checksum::none;
  PoseReport report;
  report.V_BH.linear_m_per_s = {1, 2, 3};
  report.buttons = 3;
  report.motors_on = true;
  const PoseReport decoded = round_trip(layout, report);
  CHECK(decoded.V_BH.linear_m_per_s == Vector3d::Zero());
  CHECK(decoded.buttons == 0);
  CHECK_FALSE(decoded.motors_on);
}

TEST_CASE("a pose may arrive in parts") {
  PoseReportLayout position = kPose, orientation = kPose;
  position.orientation.present = false;
  orientation.position.present = false;
  PoseReport sent;
  sent.X_BH.translation_m = {0.1, 0.2, 0.3};
  sent.X_BH.rotation = Quaterniond(0.5, 0.5, 0.5, 0.5);
  ReportBuffer bytes;
  PoseReport received;
  encode(position, sent, bytes);
  CHECK(decode_into(position, bytes, received) == Decoding::ok);
  CHECK(received.X_BH.rotation.isApprox(Quaterniond::Identity()));
  encode(orientation, sent, bytes);
  CHECK(decode_into(orientation, bytes, received) == Decoding::ok);
  CHECK(received.X_BH.translation_m.isApprox(sent.X_BH.translation_m, 1e-7));
  CHECK(received.X_BH.rotation.isApprox(sent.X_BH.rotation, 1e-8));
  const PoseReport before = received;
  bytes[20] ^= 1;
  CHECK(decode_into(orientation, bytes, received) == Decoding::bad_checksum);
  CHECK(received.X_BH.rotation.coeffs() == before.X_BH.rotation.coeffs());
}

}  // namespace wrenchd::test_report_codec
