// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdlib>
#include <numbers>

#include <catch2/catch.hpp>

#include "config/known_profiles.hpp"
#include "config/load_profile.hpp"
#include "config/toml_file.hpp"
#include "devices/layout_check.hpp"
#include "devices/profile_reports.hpp"
#include "devices/six_axes.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/hex_text.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tools/propose_profile.hpp"

namespace wrenchd::test_propose_profile {

namespace {

using namespace test;

std::string proposal(const Bytes& bytes) {
  return propose_profile({bytes, "a test", "usb 046d:c626, \"SpaceNavigator\"", UsbId{0x046d, 0xc626}});
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Returns the message with which the profile is rejected.
std::string rejection_text(const std::string& text) {
  const TemporaryDirectory dir;
  const auto file = dir.write("proposed.toml", text);
  CHECK_NOTHROW(read_toml_file(file));  // the text is valid TOML
  try {
    load_profile(file);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

/// Completes the lines marked FILL IN with values that no descriptor contains.
std::string completed(std::string text) {
  const std::array<std::array<std::string, 2>, 8> known = {{{"report_rate_Hz", "62.5"},
                                                            {"stale_fault_s", "0.2"},
                                                            {"watchdog_s", "0.008"},
                                                            {"usb", "[\"1209:0003\"]"},
                                                            {"max_force_N", "5.0"},
                                                            {"max_torque_Nm", "0.3"},
                                                            {"max_linear_speed_m_per_s", "0.5"},
                                                            {"max_angular_speed_rad_per_s", "5.0"}}};
  for (const auto& [key, value] : known) {
    const std::size_t at = text.find("# FILL IN: " + key + " =");
    if (at == std::string::npos) continue;
    text.replace(at, text.find('\n', at) - at, key + " = " + value);
  }
  const std::size_t name = text.find("name = \"unnamed\"");
  if (name != std::string::npos) text.replace(name, text.find('\n', name) - name, "name = \"mine\"");
  return text;
}

DeviceProfile loaded(const std::string& text) {
  const TemporaryDirectory dir;
  return load_profile(dir.write("proposed.toml", text));
}

/// Returns the descriptor of six unsigned bytes from 0 to 255, at rest at the middle count.
Bytes unsigned_axes() {
  return from_hex(
      "05 01 09 08 a1 01 85 07 15 00 26 ff 00 75 08 95 06 09 30 09 31 09 32 09 33 09 34 09 35 81 02 c0");
}

std::string text_of(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

TEST_CASE("a proposal contains the content of the descriptor", "[propose_profile]") {
  const std::string text = proposal(space_navigator());
  CHECK(holds(text, "# Made from a test\n# Device: usb 046d:c626, \"SpaceNavigator\"\n"));
  CHECK(holds(text,
              "#   input report 0x01, 7 bytes\n#     byte 1: 3 x 16 bits, -350 to 350, 01:30 (X) to 01:32 "
              "(Z), relative\n"));
  CHECK(holds(text, "#     byte 1 bit 2: 14 bits of padding\n"));
  CHECK(holds(text, "[match]\nusb = [\"046d:c626\"]\nusage_page = 0x01\nusage = 0x08\n"));
  CHECK(holds(text, "\nbase_axes = [\"-y\", \"-x\", \"-z\"]\n"));
  CHECK(holds(text, "\nwrench_report = \"none\" "));
  CHECK(holds(text, "[pose_report]\nid = 0x01\nlength = 7\n"));
  CHECK(holds(text, "\ntranslation = { byte = 1, type = \"i16\", step_m = 4e-06 }\n"));
  CHECK(holds(text, "# Rx 16 bits from byte 1, -350 to 350; Ry 16 bits from byte 3, -350 to 350;"));
  CHECK(holds(text, "# GUESSED: the step. The descriptor gives no angle per count;"));
  CHECK(holds(text, "\nid = 0x03\nlength = 3\n# Buttons: 2 bits from byte 1.\n"));
  CHECK(holds(text, "# LED: byte 1 of output report 0x04;"));
}

TEST_CASE("limits are never guessed, and no proposal loads before its completion", "[propose_profile]") {
  for (const Bytes& bytes : {space_navigator(), space_mouse_wireless(), home_made_combined(), ten_bit_axes(),
                             teensy_rawhid(), effects_joystick()}) {
    const std::string text = proposal(bytes);
    INFO(text);
    const std::string why = rejection_text(text);
    for (const char* key :
         {"report_rate_Hz", "limits.max_linear_speed_m_per_s", "limits.max_angular_speed_rad_per_s"})
      CHECK(holds(why, "key '" + std::string(key) + "' is missing"));
    for (const char* key : {"watchdog_s", "limits.max_force_N", "limits.max_torque_Nm"})
      CHECK(holds(why, "key '" + std::string(key) + "' is missing") !=
            holds(text, "\nwrench_report = \"none\" "));
    CHECK_FALSE(holds(why, "not known"));  // the format knows every key that the proposal writes
  }
}

TEST_CASE("a completed proposal of a multi-axis controller loads, and agrees with its device",
          "[propose_profile]") {
  for (const Bytes& bytes : {space_navigator(), space_mouse_wireless(), home_made_combined(),
                             home_made_split(), ten_bit_axes(), unsigned_axes()}) {
    const std::string text = completed(proposal(bytes));
    INFO(text);
    CHECK_FALSE(holds(text, "# FILL IN"));
    const DeviceProfile profile = loaded(text);
    CHECK(find_differences(parse_report_descriptor(bytes), expected_reports(profile)).empty());
    CHECK(profile.transport == Transport::hidraw);
    CHECK(profile.stream == StreamStyle::silent_at_rest);
    CHECK_FALSE(profile.has_output);
    CHECK(profile.match.usb == std::vector<UsbId>{{0x046d, 0xc626}});
    CHECK(profile.X_BD.rotation.isApprox(
        Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Vector3d(1, -1, 0).normalized()))));
    CHECK(sensed_dofs(profile) == kAllDofs);
    CHECK(driven_dofs(profile) == kNoDof);
    REQUIRE(profile.deflection);
    CHECK(profile.deflection->mode == Deflection::Mode::rate);
  }
}

TEST_CASE("full deflection gives the same speed for every range of counts", "[propose_profile]") {
  struct Expected {
    Bytes bytes;
    double counts;
  };
  for (const Expected& expected : {Expected{space_navigator(), 350.0},
                                   {home_made_split(), 350.0},
                                   {ten_bit_axes(), 512.0},
                                   {unsigned_axes(), 128.0}}) {
    const DeviceProfile profile = loaded(completed(proposal(expected.bytes)));
    const PoseReportLayout& pose = profile.pose_report;
    const ReportField& rotation = pose.rotation.present ? pose.rotation : profile.more_reports.at(0).rotation;
    REQUIRE(rotation.present);
    CHECK(profile.deflection->linear_gain * pose.translation.step * expected.counts ==
          Approx(0.1).epsilon(0.01));
    CHECK(profile.deflection->angular_gain * rotation.step * expected.counts == Approx(1.0).epsilon(0.01));
    CHECK(profile.deflection->full_deflection_m ==
          Approx(pose.translation.step * expected.counts).epsilon(1e-3));
    CHECK(profile.deflection->full_deflection_rad == Approx(rotation.step * expected.counts).epsilon(1e-3));
    CHECK(profile.deflection->has_proxy_distance_limit());
  }
}

TEST_CASE("fields may have any width and start at any bit; unsigned axes get an offset",
          "[propose_profile]") {
  const std::string text = proposal(ten_bit_axes());
  CHECK(holds(text, "The device's reports, without ids:\n"));
  CHECK(holds(text, "id = \"none\"\nlength = 8\n"));
  CHECK(holds(text, "\ntranslation = { byte = 0, bit = 3, bits = 10, step_m = "));
  CHECK(holds(text, "\nrotation = { byte = 4, bit = 1, bits = 10, step_rad = "));
  CHECK(holds(text, "\nbuttons = { byte = 0, bits = 3 }\n"));
  const std::string middle = proposal(unsigned_axes());
  CHECK(holds(middle, "# GUESSED: the offset, which assumes the count 128 for the undeflected puck."));
  const PoseReportLayout pose = loaded(completed(middle)).pose_report;
  CHECK_FALSE(pose.translation.is_signed);
  CHECK(pose.translation.step * 128 + pose.translation.offset == Approx(0.0).margin(1e-12));
  CHECK(pose.rotation.step * 128 + pose.rotation.offset == Approx(0.0).margin(1e-12));
}

TEST_CASE("axes that no field can represent are left open", "[propose_profile]") {
  // Z before Y.
  const std::string text = proposal(
      from_hex("05 01 09 08 a1 01 15 81 25 7f 75 08 95 06 09 30 09 32 09 31 09 33 09 34 09 35 81 02 c0"));
  CHECK(holds(text, "# FILL IN: translation. X 8 bits from byte 0, -127 to 127; Y 8 bits from byte 2"));
  CHECK(holds(text, "# FILL IN: linear_gain =\n"));
  CHECK_FALSE(holds(text, "\ntranslation ="));
  CHECK(holds(text, "\nrotation = { byte = 3, type = \"i8\""));
}

TEST_CASE("three axes form one field only if width, sign, step and middle count are equal",
          "[propose_profile]") {
  const auto three = [](const std::string& x, const std::string& y_and_z) {
    return proposal(from_hex("05 01 09 08 a1 01 75 08 95 01" + x + "09 30 81 02" + y_and_z +
                             "09 31 81 02 09 32 81 02 15 81 25 7f 09 33 81 02 09 34 81 02 09 35 81 02 c0"));
  };
  const auto left_open = [](const std::string& text) { return holds(text, "# FILL IN: translation. X "); };
  const std::string whole_byte = "15 00 26 ff 00", half_range = "15 00 25 64", with_sign = "15 81 25 7f";
  CHECK_FALSE(left_open(three(whole_byte, whole_byte)));
  CHECK_FALSE(left_open(three(with_sign, with_sign)));
  CHECK_FALSE(left_open(three(with_sign, "15 9c 25 64")));  // a smaller range, but the same middle count
  CHECK(left_open(three(whole_byte, half_range)));
  CHECK(left_open(three(with_sign, whole_byte)));
  CHECK(left_open(three(with_sign, "75 10")));
  CHECK(left_open(three(with_sign + "55 0e 65 11", "35 00 45 01")));  // different steps
  CHECK(left_open(three(with_sign + "55 0e 65 11", "65 00")));        // one step, and no step
}

TEST_CASE("a profile accepts the steps of 32-bit axes", "[propose_profile]") {
  const Bytes bytes = from_hex(
      "05 01 09 08 a1 01 17 00 00 00 80 27 ff ff ff 7f 75 20 95 06 09 30 09 31 09 32 09 33 09 34 09 35 81 02 "
      "c0");
  const DeviceProfile profile = loaded(completed(proposal(bytes)));
  CHECK(profile.pose_report.translation.bits == 32);
  CHECK(find_differences(parse_report_descriptor(bytes), expected_reports(profile)).empty());
}

TEST_CASE("buttons become a mask of 32, or are left open if other fields lie between them",
          "[propose_profile]") {
  const std::string axes =
      "05 01 09 08 a1 01 15 81 25 7f 75 08 95 06 09 30 09 31 09 32 09 33 09 34 09 35 81 02";
  const std::string bit = "05 09 15 00 25 01 75 01";
  const Bytes many = from_hex(axes + bit + "19 01 29 28 95 28 81 02 c0");
  CHECK(
      holds(proposal(many), "# Buttons: 40 bits from byte 6. Only the first 32, the capacity of a mask.\n"));
  CHECK(loaded(completed(proposal(many))).pose_report.buttons.bits == 32);
  // A button, seven bits of a dial, a button, padding.
  const std::string apart = proposal(from_hex(axes + bit + "09 01 95 01 81 02 05 01 09 37 75 07 81 02" + bit +
                                              "09 02 81 02 95 07 81 03 c0"));
  CHECK(
      holds(apart, "# Buttons: 9 bits from byte 6. Other fields lie between them:\n# FILL IN: button_list"));
  CHECK_FALSE(holds(apart, "\nbuttons ="));
}

TEST_CASE("a report that is too long for a profile is reported", "[propose_profile]") {
  const std::string text =
      proposal(from_hex("06 ab ff 0a 00 02 a1 01 75 08 15 00 26 ff 00 95 41 09 01 81 02 c0"));
  CHECK(holds(
      text, "# FILL IN: length. The device's report has 65 bytes, but a profile's report has at most 64.\n"));
  CHECK_FALSE(holds(text, "\nlength ="));
  CHECK(holds(text, "\nwrench_report = \"none\" "));
}

TEST_CASE("a multi-axis controller with a vendor-defined output report may have motors",
          "[propose_profile]") {
  const std::string text =
      proposal(from_hex("05 01 09 08 a1 01 15 81 25 7f 75 08 95 06 09 30 09 31 09 32 09 33 09 34 09 35 81 02"
                        "06 00 ff 09 01 95 0c 91 02 c0"));
  CHECK_FALSE(holds(text, "\nwrench_report = \"none\" "));
  CHECK(holds(text, "\n[wrench_report]\nid = \"none\""));
  for (const char* key : {"watchdog_s", "max_force_N", "max_torque_Nm"})
    CHECK(holds(text, "# FILL IN: " + std::string(key) + " ="));
}

TEST_CASE("a proposal says first which profiles already fit the device", "[propose_profile]") {
  const auto shipped = known_profiles(SearchPath({test::source_path("config")})).profiles;
  DescriptorSource mouse{space_navigator(), "a test", {}, UsbId{0x046d, 0xc626}};
  CHECK(fitting_profiles(mouse, shipped) == std::vector<std::string>{"spacemouse_split"});
  const std::string text = propose_profile(mouse, fitting_profiles(mouse, shipped));
  CHECK(text.rfind(
            "# The profile spacemouse_split already fits this device: set profile = \"spacemouse_split\"",
            0) == 0);
  mouse.id = UsbId{0x1209, 0x4242};  // another id
  CHECK(fitting_profiles(mouse, shipped).empty());
  mouse.id.reset();
  CHECK(fitting_profiles(mouse, shipped) == std::vector<std::string>{"spacemouse_split"});
  CHECK(holds(propose_profile(mouse, {"spacemouse_split"}), "if its ids match or you name it"));
  CHECK(fitting_profiles({home_made_combined(), "a test", {}, UsbId{0x256f, 0xc6ff}}, shipped) ==
        std::vector<std::string>{"spacemouse_combined"});
}

TEST_CASE("unknown device ids are left open", "[propose_profile]") {
  const std::string text = propose_profile({space_navigator(), "a test", {}, {}});
  CHECK(holds(text, "[match]\n# FILL IN: usb ="));
  CHECK(loaded(completed(text)).match.usb == std::vector<UsbId>{{0x1209, 0x0003}});
}

TEST_CASE("vendor-defined reports are proposed with their ids and lengths only", "[propose_profile]") {
  const std::string text = proposal(teensy_rawhid());
  CHECK(holds(text, "\n[pose_report]\nid = \"none\""));
  CHECK(holds(text, "\nlength = 64\n"));
  CHECK_FALSE(holds(text, "reference report layout"));
  const std::string reference = proposal(from_hex(
      "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 1f 91 02 c0"));
  CHECK(holds(reference, "copy both tables below from profiles/loopback.toml"));
  CHECK(holds(reference, "\n[wrench_report]\nid = 0x02"));
}

TEST_CASE("a completed proposal of the reference layout loads", "[propose_profile]") {
  // The limits and timing are filled in; the report tables come from profiles/loopback.toml.
  std::string text = proposal(from_hex(
      "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 1f 91 02 c0"));
  text = completed(text);
  std::ifstream stream(test::source_path("config/profiles/loopback.toml"));
  const std::string loopback{std::istreambuf_iterator<char>(stream), {}};
  text = text.substr(0, text.find("[pose_report]")) + loopback.substr(loopback.find("[pose_report]"));
  CHECK(rejection_text(text).empty());
}

TEST_CASE("a hostile name cannot leave its comment", "[propose_profile]") {
  const std::string text =
      propose_profile({space_navigator(), "a\nmax_force_N = 100", "\xff\xfe\n[limits]\r"});
  CHECK(holds(text, "# Made from a?max_force_N = 100\n# Device: ???[limits]?\n"));
  CHECK(holds(rejection_text(text), "key 'limits.max_linear_speed_m_per_s' is missing"));
}

TEST_CASE("for any descriptor a proposal is valid TOML without limits", "[propose_profile]") {
  RandomValues random(21);
  const int cases = case_count(20'000);
  int proposed = 0;
  for (int i = 0; i < cases; ++i) {
    try {
      const std::string text = proposal(malformed_descriptor(random));
      const TomlNode root = read_toml_text(text, "proposed.toml");
      for (const TomlEntry& entry : std::get<TomlNode::Table>(root.value))
        if (entry.key == "limits") CHECK(std::get<TomlNode::Table>(entry.node.value).empty());
      ++proposed;
    } catch (const ConfigError& error) {
      FAIL(error.what());
    } catch (const std::runtime_error& rejection) {
      if (!holds(rejection.what(), "a test: ")) FAIL(rejection.what());
    }
  }
  CHECK(proposed > cases / 20);
}

TEST_CASE("for any six axes a complete proposal loads and agrees with the descriptor", "[propose_profile]") {
  RandomValues random(22);
  const int cases = case_count(20'000);
  int complete = 0;
  for (int i = 0; i < cases; ++i) {
    const Bytes bytes = malformed_descriptor(random);
    std::string text;
    try {
      if (!find_six_axes(parse_report_descriptor(bytes)).controller) continue;
      text = completed(proposal(bytes));
    } catch (const DescriptorError&) {
      continue;
    }
    if (holds(text, "# FILL IN")) continue;
    INFO(text);
    CHECK(find_differences(parse_report_descriptor(bytes), expected_reports(loaded(text))) ==
          std::vector<std::string>{});
    ++complete;
  }
  CHECK(complete > cases / 50);
}

TEST_CASE("a device without six axes or vendor-defined reports is rejected", "[propose_profile]") {
  CHECK_THROWS_WITH(
      proposal(boot_keyboard()),
      "a test: nothing to propose: it is no multi-axis controller (01:08); its applications are 01:06 "
      "(keyboard), and no report is vendor-defined; name another device");
  CHECK_THROWS_WITH(proposal(from_hex("05 01 c0")),
                    "a test: report descriptor, byte 2: ends a collection, but none is open");
}

TEST_CASE("hexadecimal text is parsed in all usual notations", "[propose_profile]") {
  const Bytes expected = {0x05, 0x01, 0x09, 0x08};
  for (const char* text :
       {"05 01 09 08", "0x05, 0x01,\n0X09, 0x08,\n", "05010908", "\t05 01 # usage page\r\n09 08",
        "0x05, 0x01,  // Usage Page (Generic Desktop)\n0x09, 0x08", "\n\n0501\n0908\n"})
    CHECK(parse_hex_text(text) == expected);
  CHECK(parse_hex_text("# nothing").empty());
  CHECK_THROWS_WITH(parse_hex_text("05 01\n 5 01"),
                    Catch::Contains("2:2: expected bytes with two") && Catch::Contains("found '5'"));
  CHECK_THROWS_WITH(parse_hex_text("0x"), Catch::Contains("1:1: "));
  CHECK_THROWS_WITH(parse_hex_text("05 0g"), Catch::Contains("1:4: "));
  CHECK_THROWS_WITH(parse_hex_text("05 01 / 09"), Catch::Contains("1:7: "));
}

TEST_CASE("wrenchctl profile reads bytes and hexadecimal text alike", "[propose_profile]") {
  const TemporaryDirectory dir;
  const Bytes bytes = space_mouse_wireless();
  const auto raw = dir.write("report_descriptor", text_of(bytes));
  std::string hex;
  for (const std::uint8_t byte : bytes)
    hex += "0x" + std::string(1, "0123456789abcdef"[byte >> 4U]) + "0123456789abcdef"[byte & 15U] + ",\n";
  const auto text = dir.write("descriptor.txt", hex);

  const ProgramResult a = run_program("wrenchctl", {"profile", "--from", raw.string()});
  CHECK(a.exit_code == 0);
  CHECK(a.err.empty());
  CHECK(holds(a.out, "length = 13\n"));
  const ProgramResult b =
      run_program("wrenchctl", {"profile", "--from", text.string(), "-o", (dir.path() / "p").string()});
  CHECK(b.exit_code == 0);
  CHECK(b.out.empty());
  std::ifstream written(dir.path() / "p");
  const std::string proposed{std::istreambuf_iterator<char>(written), {}};
  CHECK(proposed.substr(proposed.find("# The device's reports")) ==
        a.out.substr(a.out.find("# The device's reports")));
}

#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // umockdev and the sanitizers must both be loaded first
/// Returns the number as four bytes, little-endian.
Bytes four_bytes(std::size_t x) {
  return {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(x >> 8U), 0, 0};
}

TEST_CASE("wrenchctl profile reads the report descriptor of a hidraw device from the kernel",
          "[propose_profile]") {
  const TemporaryDirectory dir;
  const auto device = dir.write("device",
                                "P: /devices/virtual/hidraw/hidraw0\nN: hidraw0\nE: DEVNAME=/dev/hidraw0\n"
                                "E: MAJOR=243\nE: MINOR=0\nE: SUBSYSTEM=hidraw\n");
  const Bytes descriptor = space_navigator();
  Bytes answer = four_bytes(descriptor.size());  // struct hidraw_report_descriptor
  answer.insert(answer.end(), descriptor.begin(), descriptor.end());
  answer.resize(4 + 4096);
  std::string name = "3Dconnexion SpaceNavigator";
  name.resize(255);
  const auto answers = dir.write(
      "answers", "@DEV /dev/hidraw0\nHIDIOCGRDESCSIZE 0 " + hex_text(four_bytes(descriptor.size())) +
                     "\nHIDIOCGRDESC 0 " + hex_text(answer) + "\nHIDIOCGRAWINFO 0 030000006D0426C6\n" +
                     "HIDIOCGRAWNAME 27 " + hex_text(Bytes(name.begin(), name.end())) + "\n");
  const std::string out = (dir.path() / "out").string();
  const std::string command = "umockdev-run -d " + device.string() + " -i /dev/hidraw0=" + answers.string() +
                              " -- " + test::program_path("wrenchctl") + " profile --from /dev/hidraw0 -o " +
                              out;
  REQUIRE(std::system(command.c_str()) == 0);
  std::ifstream stream(out);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  CHECK(holds(text, "# Made from /dev/hidraw0\n# Device: usb 046d:c626, \"3Dconnexion SpaceNavigator\"\n"));
  CHECK(text.substr(text.find("# The device's reports")) ==
        proposal(descriptor).substr(proposal(descriptor).find("# The device's reports")));
}
#endif

TEST_CASE("wrenchctl profile rejects invalid sources with location and remedy", "[propose_profile]") {
  const TemporaryDirectory dir;
  const auto rejects = [&](const std::string& from, const std::string& why) {
    const ProgramResult result = run_program("wrenchctl", {"profile", "--from", from});
    INFO(result.err);
    CHECK(result.exit_code == 1);
    CHECK(result.out.empty());
    CHECK(result.err.find("wrenchctl: " + from + why) == 0);
  };
  rejects((dir.path() / "none").string(), ": no such file; name a /dev/hidrawN");
  rejects(dir.path().string(), ": is neither a hidraw device nor a regular file");
  rejects("/dev/null", ": is not a hidraw device; name a /dev/hidrawN");
  rejects(dir.write("empty", "").string(), ": is empty; check whether the device is still connected");
  rejects(dir.write("words", "05 01 oh").string(), ":1:7: expected bytes with two hexadecimal digits");
  rejects(dir.write("comments", "# no bytes\n").string(),
          ": report descriptor, byte 0: the descriptor is empty");
  Bytes cut = space_navigator();
  cut.pop_back();
  rejects(dir.write("cut", text_of(cut)).string(),
          ": report descriptor, byte 216: 1 collection(s) are still open");
  rejects(dir.write("large", std::string((1 << 20) + 1, '0')).string(), ": is larger than 1 MiB");
  rejects(dir.write("keyboard", text_of(boot_keyboard())).string(),
          ": nothing to propose: it is no multi-axis");

  const ProgramResult bare = run_program("wrenchctl", {"profile"});
  CHECK(bare.exit_code > 100);
  CHECK(holds(bare.err, "--from is required"));
}

}  // namespace
}  // namespace wrenchd::test_propose_profile
