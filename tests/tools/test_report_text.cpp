// SPDX-License-Identifier: GPL-3.0-or-later
#include <stdexcept>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "config/report_bytes.hpp"
#include "tests/support/paths.hpp"
#include "tools/report_text.hpp"

namespace wrenchd::test_report_text {

using Catch::Contains;
using Catch::StartsWith;

namespace {

DeviceProfile shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml");
}

std::string decoded(const std::string& profile, const std::string& hex, bool to_device = false) {
  return report_text(shipped(profile), parse_bytes(hex).bytes, to_device);
}

std::string rejected(const std::string& profile, const std::string& hex) {
  try {
    return "not rejected: " + decoded(profile, hex);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

std::string encoded(const std::string& profile, const Wrench& F, const std::string& at = {}) {
  return hex_text(encode_wrench(shipped(profile), F, parse_bytes(at).bytes).bytes);
}

}  // namespace

TEST_CASE("SpaceMouse reports are decoded in both formats", "[report_text]") {
  // 350 counts are the full deflection: 1.4 mm. X right, Y toward the user, Z down become -Y, -X, -Z.
  const std::string t = decoded("spacemouse_split", "01 5e 01 00 00 a2 fe");
  CHECK_THAT(t, Contains("translation          0.0014 0 -0.0014 m   counts 350 0 -350"));
  CHECK_THAT(t, Contains("translation in base  0 -0.0014 0.0014 m"));
  CHECK_THAT(decoded("spacemouse_split", "02 01 00 02 00 fd ff"),
             Contains("rotation             0.00025 0.0005 -0.00075 rad   counts 1 2 -3"));
  const std::string both = decoded("spacemouse_combined", "01 01 00 02 00 03 00 04 00 05 00 06 00");
  CHECK_THAT(both, Contains("counts 1 2 3\n") && Contains("counts 4 5 6\n"));
  CHECK_THAT(decoded("spacemouse_split", "03 03 00"), Contains("buttons pressed      0 1"));
  CHECK_THAT(decoded("spacemouse_split", "03 00 00 00 80"), Contains("buttons pressed      31"));
  CHECK_THAT(decoded("spacemouse_combined", "17 57 01"),
             Contains("battery_percent      87") && Contains("charging             yes"));
}

// 118 of 350 counts, with a dead zone of 8 % and a quadratic response.
TEST_CASE("the tool velocity of a puck has the dead zone and the response of the daemon", "[report_text]") {
  CHECK_THAT(decoded("spacemouse_split", "01 76 00 00 00 00 00"), Contains("tool velocity        0 -0.0077"));
  CHECK_THAT(decoded("spacemouse_split", "01 14 00 00 00 00 00"), Contains("tool velocity        0 0 0 m/s"));
  CHECK_THAT(decoded("spacemouse_split", "02 5e 01 00 00 00 00"), Contains("tool angular vel.    0 -0.997"));
}

TEST_CASE("the keys of a SpaceMouse Enterprise are decoded", "[report_text]") {
  const std::string keys = decoded("spacemouse_combined", "1c 0d 00 02 00 00 00 00 00 00 00 00 00");
  CHECK_THAT(keys,
             Contains("(keys)") && Contains("key_1                13") && Contains("key_2                2"));
}

TEST_CASE("Polhem reports are decoded, with the button inside an encoder count", "[report_text]") {
  const std::string bytes = "00 00 00 00 78 ec 0a 27 00 00 00 00 01 00";
  const std::string text = decoded("polhem", bytes);
  CHECK_THAT(text, Contains("joints               0 0 -5000 9994 0 0 counts"));
  CHECK_THAT(text, Contains("joint angles         0 0 1.57079633 0 0 0.0368155389 rad"));
  CHECK_THAT(text, Contains("position in device   -0.007 0 0.132 m"));
  CHECK_THAT(text, Contains("position in base     0.007 0 0.132 m"));
  CHECK_THAT(text, Contains("buttons pressed      0") && Contains("info                 1"));
  CHECK(decoded("polhem", "00 " + bytes) == text);  // hidapi prepends 00 to a report without id
  CHECK(decoded("polhem_lpc1768", bytes).substr(14) == text.substr(6 + 8));
}

TEST_CASE("a Falcon's nibbles are encoders, buttons and homing", "[report_text]") {
  // 0x05a7 = 1447, the example in the documentation of libnifalcon: nibbles 7 a 5 0, least significant first.
  const std::string text = decoded("falcon", "3c 48 4b 46 41 41 41 41 41 50 50 50 50 52 41 3e");
  CHECK_THAT(text, Contains("joints               1447 0 -1 counts"));
  CHECK_THAT(text, Contains("homed                no   bits 1 0 0") && Contains("buttons pressed      0"));
  CHECK(decoded("falcon", "01 60 3c 48 4b 46 41 41 41 41 41 50 50 50 50 52 41 3e") == text);
  const std::string home = decoded("falcon", "3c 41 41 41 41 41 41 41 41 41 41 41 41 b1 41 3e");
  CHECK_THAT(home, Contains("homed                yes") && Contains("buttons pressed      none"));
  CHECK_THAT(home, Contains("joint angles         0.610865238 0.610865238 0.610865238 rad"));
}

TEST_CASE("a wrench is encoded in the bytes that the firmware expects", "[report_text]") {
  // The example of README.md with another sequence and checksum.
  CHECK_THAT(encoded("loopback", {{1, -2.5, 0}, {0, 0.05, -0.1}}),
             StartsWith("02 01 01 00 40 42 0f 00 60 da d9 ff 00 00 00 00 00 00 00 00 50 c3 00 00 60 79 fe "
                        "ff 08 00"));
  CHECK(encoded("reference_full_speed", {{1, -2.5, 0}, {0, 0.05, -0.1}}) ==
        encoded("loopback", {{1, -2.5, 0}, {0, 0.05, -0.1}}));

  // Polhem at home, 1 N up: body c carries 0.133 N.m, its motor -0.0133 N.m: -247.2 mA. Forward in the base
  // is back in the device: body b's arm of 0.174 m gives -(-0.0174) / 0.0538 A = 323.4 mA.
  CHECK(encoded("polhem_lpc1768", {{0, 0, 1}, {0, 0, 0}}) == "00 00 00 00 09 ff 00 00 00 00 00 00 00 00");
  CHECK(encoded("polhem_lpc1768", {{1, 0, 0}, {0, 0, 0}}) == "00 00 43 01 00 00 00 00 00 00 00 00 00 00");
  CHECK(encode_wrench(shipped("polhem"), {}).bytes.size() == 64);

  // Falcon: at 0 the three legs are equal, so a force along the axis gives three equal efforts. A forward
  // force pushes the handle into the device. The motor counts have the opposite sign of the encoder counts.
  const std::string forward = encoded("falcon", {{1, 0, 0}, {0, 0, 0}});
  CHECK(forward == "3c 4a 50 41 41 4a 50 41 41 4a 50 41 41 42 41 3e");
  CHECK(encoded("falcon", {{-1, 0, 0}, {0, 0, 0}}) == "3c 48 41 50 50 48 41 50 50 48 41 50 50 42 41 3e");
  CHECK(encoded("falcon", {}) == "3c 41 41 41 41 41 41 41 41 41 41 41 41 42 41 3e");
}

TEST_CASE("the motor efforts depend on the handle pose", "[report_text]") {
  const std::string aside = "3c 41 48 41 41 41 41 41 41 41 41 41 41 b1 41 3e";
  CHECK(encoded("falcon", {{1, 0, 0}, {0, 0, 0}}, aside) != encoded("falcon", {{1, 0, 0}, {0, 0, 0}}));
  const std::string unhomed = "3c 41 48 41 41 41 41 41 41 41 41 41 41 41 41 3e";
  const EncodedWrench none =
      encode_wrench(shipped("falcon"), {{1, 0, 0}, {0, 0, 0}}, parse_bytes(unhomed).bytes);
  CHECK(hex_text(none.bytes) == "3c 41 41 41 41 41 41 41 41 41 41 41 41 42 41 3e");
  CHECK_THAT(none.remarks.front(), Contains("not homed"));
}

TEST_CASE("clamped and dropped components are reported", "[report_text]") {
  const EncodedWrench e = encode_wrench(shipped("polhem"), {{9, 0, 0}, {0, 0.1, 0}});
  REQUIRE(e.remarks.size() == 3);
  CHECK_THAT(e.remarks[0], StartsWith("at the home pose, which the device reports as 00 00 "));
  CHECK(e.remarks[1] == "the force is limited from 9 to 5 N, the limit in the profile");
  CHECK(e.remarks[2] == "dropped, because there are no motors: ry");
  CHECK_THROWS_WITH(encode_wrench(shipped("spacemouse_split"), {}), Contains("has no motors"));
}

TEST_CASE("bytes that match no report are rejected with the reason for each report", "[report_text]") {
  CHECK_THAT(rejected("spacemouse_split", "01 00 00"),
             Contains("these 3 bytes match no report of spacemouse_split") &&
                 Contains("report 0x01 (translation) has 7 bytes, found 3") &&
                 Contains("report 0x03 (buttons) begins with another id: found 01"));
  CHECK_THAT(rejected("falcon", "3c 41 41 41 41 41 41 41 41 41 41 41 41 41 3e"),
             Contains("report has 16 bytes, found 15"));
  CHECK_THAT(rejected("falcon", "3c 41 41 41 41 41 41 41 41 41 41 41 41 41 3e 00"),
             Contains("has 3e at byte 15, found 00"));
  CHECK_THAT(rejected("loopback", hex_text(std::vector<std::uint8_t>(64, 1))), Contains("another checksum"));
  CHECK_THAT(rejected("falcon", ""), Contains("no bytes"));
}

TEST_CASE("bytes are parsed in all usual notations", "[report_text]") {
  using Bytes = std::vector<std::uint8_t>;
  CHECK(parse_bytes("01 a0 FF").bytes == Bytes{1, 0xa0, 0xff});
  CHECK(parse_bytes("01a0ff").bytes == Bytes{1, 0xa0, 0xff});
  CHECK(parse_bytes(" 0x01, 0XA0:ff\n").bytes == Bytes{1, 0xa0, 0xff});
  CHECK(parse_bytes("").bytes.empty());
  CHECK(parse_bytes("01 g0").error_index == 3);
  CHECK_FALSE(parse_bytes("01 g0").error.empty());
  CHECK_FALSE(parse_bytes("01 a").error.empty());
  CHECK_FALSE(parse_bytes("0x").error.empty());
}

}  // namespace wrenchd::test_report_text
