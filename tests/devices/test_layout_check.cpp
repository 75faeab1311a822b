// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/layout_check.hpp"
#include "devices/profile_reports.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_layout_check {

namespace {

using namespace test;
using Lines = std::vector<std::string>;

ReportDescriptor parsed(const Bytes& bytes) {
  return parse_report_descriptor(bytes);
}

/// The descriptor in devices/README.md.
const std::string kReference =
    "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 1f 91 02 c0";
ReportDescriptor reference_device() {
  return parsed(from_hex(kReference));
}

/// Six axes as in a SpaceMouse profile, with the differences of the test.
ExpectedReport combined(std::vector<ExpectedField> fields, std::size_t length = 13) {
  return {ReportKind::input, 1, length, std::move(fields)};
}

TEST_CASE("the reference layout agrees with the descriptor in devices/README.md", "[layout_check]") {
  const auto expected = expected_reports(reference_profile());
  REQUIRE(expected.size() == 2);
  CHECK(expected[0].fields.size() == 11);
  CHECK(expected[1].fields.size() == 6);
  CHECK(find_differences(reference_device(), expected) == Lines{});
}

TEST_CASE("a profile for another device differs, one line per difference", "[layout_check]") {
  const Lines lines = find_differences(parsed(space_mouse_wireless()), expected_reports(reference_profile()));
  REQUIRE(lines.size() == 13);  // no field agrees
  CHECK(lines[0] == "input report 0x01: the profile has 64 bytes, the device 13");
  CHECK(lines[1] ==
        "input report 0x01, checksum: the profile has 16 bits, unsigned, from byte 62; the device's report "
        "ends with byte 12");
  CHECK(lines[2] ==
        "input report 0x01, motors_on: the profile has 1 bit, unsigned, at byte 1; the device has "
        "01:30 (X), 16 bits, signed, from byte 1");
  CHECK(lines[6] ==
        "input report 0x01, position[0]: the profile has 32 bits, signed, from byte 8; the device has "
        "01:33 (Rx), 16 bits, signed, from byte 7; 01:34 (Ry), 16 bits, signed, from byte 9; 01:35 (Rz), "
        "16 bits, signed, from byte 11");
  CHECK(lines.back() == "output report 0x02: the device has no such report; its output reports: 0x04");
}

TEST_CASE("a field agrees if position, width and sign match", "[layout_check]") {
  const ReportDescriptor device = parsed(space_mouse_wireless());
  const auto lines = [&](const ExpectedField& field) {
    return find_differences(device, {combined({field})});
  };
  CHECK(lines({"translation", 8, 16, 3, true}).empty());
  CHECK(lines({"all six", 8, 16, 6, true}).empty());
  CHECK(lines({"too many", 8, 16, 7, true}).size() == 1);
  CHECK(lines({"unsigned", 8, 16, 1, false}).size() == 1);
  CHECK(lines({"half", 8, 8, 1, true}).size() == 1);
  CHECK(lines({"a bit of it", 8, 1, 1, false}).size() == 1);
  CHECK(lines({"off by one byte", 16, 16, 1, true}).size() == 1);
  CHECK(lines({"off by one bit", 9, 16, 1, true}).size() == 1);
  CHECK(lines({"twice as wide", 8, 32, 1, true}).size() == 1);
  CHECK(lines({"the report id", 0, 8, 1, false}).size() == 1);
}

TEST_CASE("a button mask consists of single bits and trailing padding", "[layout_check]") {
  const ReportDescriptor device = parsed(space_navigator());
  const auto agrees = [&](std::size_t bit, unsigned bits) {
    return find_differences(device, {{ReportKind::input, 3, 3, {{"buttons", bit, bits, 1, false}}}}).empty();
  };
  CHECK(agrees(8, 1));
  CHECK(agrees(9, 1));
  CHECK(agrees(8, 2));
  CHECK(agrees(8, 8));
  CHECK(agrees(8, 16));
  CHECK_FALSE(agrees(10, 1));
  CHECK_FALSE(agrees(16, 8));
  CHECK_FALSE(agrees(8, 17));

  // Two axes of one byte each are two values, not one of two bytes.
  const ReportDescriptor mouse =
      parsed(from_hex("05 01 09 02 a1 01 15 81 25 7f 75 08 95 02 09 30 09 31 81 06 c0"));
  CHECK(find_differences(mouse, {{ReportKind::input, {}, 2, {{"axis", 0, 8, 2, true}}}}).empty());
  CHECK(find_differences(mouse, {{ReportKind::input, {}, 2, {{"both", 0, 16, 1, true}}}}).size() == 1);
}

TEST_CASE("vendor-defined bytes agree with any field within them", "[layout_check]") {
  const ReportDescriptor device = parsed(teensy_rawhid());
  const auto agrees = [&](const ExpectedField& field) {
    return find_differences(device, {{ReportKind::input, {}, 64, {field}}}).empty();
  };
  CHECK(agrees({"encoders", 0, 16, 6, true}));
  CHECK(agrees({"a bit", 77, 1, 1, false}));
  CHECK(agrees({"a nibble and more", 4, 12, 1, true}));
  CHECK(agrees({"all", 0, 64, 8, false}));
  CHECK_FALSE(agrees({"one more", 0, 8, 65, false}));
}

TEST_CASE("a field may use bits of one vendor-defined word, but not cross its boundary", "[layout_check]") {
  const ReportDescriptor device =
      parsed(from_hex("06 00 ff 09 01 a1 01 16 00 80 26 ff 7f 75 10 95 04 09 02 81 02 c0"));
  const auto agrees = [&](const ExpectedField& field) {
    return find_differences(device, {{ReportKind::input, {}, 8, {field}}}).empty();
  };
  CHECK(agrees({"word", 16, 16, 3, true}));
  CHECK(agrees({"flag", 19, 1, 1, false}));
  CHECK_FALSE(agrees({"sign", 16, 16, 1, false}));
  CHECK_FALSE(agrees({"across", 8, 16, 1, true}));
  CHECK_FALSE(agrees({"two", 0, 32, 1, true}));
}

TEST_CASE("report ids without a counterpart are reported", "[layout_check]") {
  const ExpectedReport with{ReportKind::input, 1, 65, {}}, without{ReportKind::input, {}, 64, {}};
  CHECK(find_differences(parsed(teensy_rawhid()), {without}).empty());
  CHECK(find_differences(parsed(teensy_rawhid()), {with}) ==
        Lines{"input report 0x01: the device has no such report; its input reports: without an id"});
  CHECK(
      find_differences(parsed(space_navigator()), {without}) ==
      Lines{
          "input report without an id: the device has no such report; its input reports: 0x01, 0x02, 0x03"});
  CHECK(find_differences(parsed(ten_bit_axes()), {{ReportKind::output, {}, 2, {}}}) ==
        Lines{"output report without an id: the device has no such report; it has no output report"});
}

TEST_CASE("a report may have its minimum length, and an optional report may be absent", "[layout_check]") {
  const ReportDescriptor device = parsed(space_navigator());  // report 3 has 3 bytes, with 2 buttons
  const ExpectedField buttons{"buttons", 8, 32, 1, false};
  ExpectedReport report{ReportKind::input, 3, 7, {buttons}};
  CHECK(find_differences(device, {report}).size() == 2);  // its length, and the field beyond its end
  report.min_length = 3;
  CHECK(find_differences(device, {report}) == Lines{});
  report.min_length = 4;
  CHECK(find_differences(device, {report}).size() == 2);
  const ExpectedField axis{"axis", 8, 16, 6, false};  // an axis that is present must agree
  CHECK(find_differences(device, {{ReportKind::input, 1, 13, {axis}, 7, false}}).size() == 1);

  report.id = 0x17;
  CHECK(find_differences(device, {report}).size() == 1);
  report.may_be_absent = true;
  CHECK(find_differences(device, {report}) == Lines{});
}

TEST_CASE("a profile without report ids expects a device without them", "[layout_check]") {
  DeviceProfile profile = reference_profile();
  profile.pose_report.has_id = false;
  profile.wrench_report.has_id = false;
  const auto expected = expected_reports(profile);
  CHECK_FALSE(expected[0].id);
  CHECK(expected[0].length == 64);
  const ReportDescriptor device =
      parsed(from_hex("06 ab ff 0a 00 02 a1 01 75 08 15 00 26 ff 00 95 40 09 01 81 02 95 20 09 02 91 02 c0"));
  CHECK(find_differences(device, expected) == Lines{});
}

TEST_CASE("shipped profiles agree with the descriptors of their devices", "[layout_check]") {
  const auto differ = [&](const char* name, const Bytes& descriptor) {
    return find_differences(
        parsed(descriptor),
        expected_reports(load_profile(test::source_path("config/profiles/") + std::string(name))));
  };
  CHECK(differ("reference_full_speed.toml", from_hex(kReference)) == Lines{});
  CHECK(differ("reference_high_speed.toml", from_hex(kReference)) == Lines{});
  CHECK(differ("polhem.toml", teensy_rawhid()) == Lines{});
  // Two bytes of buttons although the profile permits six, no battery, and a battery on another model.
  CHECK(differ("spacemouse_split.toml", space_navigator()) == Lines{});
  CHECK(differ("spacemouse_split.toml", home_made_split()) == Lines{});
  CHECK(differ("spacemouse_combined.toml", space_mouse_wireless()) == Lines{});
  CHECK(differ("spacemouse_combined.toml", home_made_combined()) == Lines{});
  CHECK_FALSE(differ("spacemouse_combined.toml", space_navigator()).empty());
  CHECK_FALSE(differ("spacemouse_split.toml", space_mouse_wireless()).empty());
}

TEST_CASE("wrenchctl check --against prints the required changes", "[layout_check]") {
  const std::string profile = test::source_path("config/profiles/loopback.toml");
  const TemporaryDirectory dir;
  const auto check = [&](const std::string& file, const std::string& descriptor) {
    const auto source = dir.write("descriptor.txt", descriptor);
    return run_program("wrenchctl", {"check", file, "--against", source.string()});
  };
  const std::string source = (dir.path() / "descriptor.txt").string();
  const ProgramResult good = check(profile, kReference);
  CHECK(good.exit_code == 0);
  CHECK(good.err.empty());
  CHECK(good.out.find(profile + ": agrees with the report descriptor of " + source + "\n") !=
        std::string::npos);

  std::string shorter = kReference;
  shorter.replace(shorter.find("95 3f"), 5, "95 3e");
  const ProgramResult bad = check(profile, shorter);
  CHECK(bad.exit_code == 1);
  CHECK(bad.err == "wrenchctl: " + profile + ": disagrees with the report descriptor of " + source +
                       "; change the profile, or name the device that it belongs to:\n"
                       "  input report 0x01: the profile has 64 bytes, the device 63\n"
                       "  input report 0x01, checksum: the profile has 16 bits, unsigned, from byte 62; the "
                       "device's report ends with byte 62\n");

  const ProgramResult scene = check(test::source_path("config/scenes/cube_on_table.toml"), kReference);
  CHECK(scene.exit_code == 1);
  CHECK(scene.err.find("cube_on_table.toml") != std::string::npos);
  const ProgramResult broken = check(profile, "05 01 c0");
  CHECK(broken.exit_code == 1);
  CHECK(broken.err ==
        "wrenchctl: " + source + ": report descriptor, byte 2: ends a collection, but none is open\n");
}

}  // namespace
}  // namespace wrenchd::test_layout_check
