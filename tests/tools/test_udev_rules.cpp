// SPDX-License-Identifier: GPL-3.0-or-later
#include <sstream>

#include <catch2/catch.hpp>

#include "config/known_profiles.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tools/udev_rules.hpp"

namespace wrenchd::test_udev_rules {

namespace {

using namespace test;

const KnownProfiles kShipped = known_profiles(SearchPath({test::source_path("config")}));

DeviceProfile profile(const std::string& name, Transport transport, std::vector<UsbId> usb) {
  DeviceProfile p;
  p.name = name;
  p.transport = transport;
  p.match.usb = std::move(usb);
  return p;
}

/// Returns the effective lines, without comments.
std::vector<std::string> rules_of(const std::vector<DeviceProfile>& profiles) {
  std::istringstream text(udev_rules(profiles));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);)
    if (!line.empty() && line[0] != '#') lines.push_back(line);
  return lines;
}

bool has(const std::string& line, const std::string& part) {
  return line.find(part) != std::string::npos;
}

TEST_CASE(
    "a device with motors: only the service can open its hidraw node, and connecting it starts the service",
    "[udev_rules]") {
  DeviceProfile arm = profile("arm", Transport::hidraw, {{0x16c0, 0x0486}});
  arm.match.usage_page = 0xffab;
  CHECK(rules_of({arm}) ==
        std::vector<std::string>{
            R"(ACTION=="remove", GOTO="wrenchd_end")",
            R"(SUBSYSTEM=="hidraw", KERNELS=="*:16C0:0486.*", GROUP="wrenchd", MODE="0660", TAG-="uaccess", )"
            R"(TAG+="systemd", ENV{SYSTEMD_WANTS}+="wrenchd.service")",
            R"(SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}=="16c0", )"
            R"(ATTR{idProduct}=="0486", TEST=="power/control", ATTR{power/control}="on")",
            R"(LABEL="wrenchd_end")"});
}

TEST_CASE("a libusb device: the rules cover its USB node, not only its power settings", "[udev_rules]") {
  const auto lines = rules_of({profile("falcon", Transport::libusb, {{0x0403, 0xcb48}})});
  REQUIRE(lines.size() == 4);
  CHECK(lines[1] ==
        R"(SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}=="0403", ATTR{idProduct}=="cb48", )"
        R"(GROUP="wrenchd", MODE="0660", TAG-="uaccess", TAG+="systemd", )"
        R"(ENV{SYSTEMD_WANTS}+="wrenchd.service")");
}

TEST_CASE("a device without motors keeps the access of other rules and moves no pointer", "[udev_rules]") {
  DeviceProfile mouse = profile("mouse", Transport::hidraw, {{0x046d, 0xc626}});
  mouse.has_output = false;
  mouse.match.usage_page = 1;
  const auto lines = rules_of({mouse});
  REQUIRE(lines.size() == 5);
  CHECK(has(lines[1], R"(KERNELS=="*:046D:C626.*")"));
  CHECK_FALSE(has(lines[1], "uaccess"));
  CHECK(lines[3] == R"(SUBSYSTEM=="input", ATTRS{idVendor}=="046d", ATTRS{idProduct}=="c626", )"
                    R"(ENV{LIBINPUT_IGNORE_DEVICE}="1")");
}

TEST_CASE("a profile that requires explicit selection gets its node and does not start the service",
          "[udev_rules]") {
  DeviceProfile named = profile("named", Transport::hidraw, {{0x16c0, 0x0486}});
  named.match.only_when_named = true;
  const auto alone = rules_of({named});
  CHECK(has(alone[1], R"(GROUP="wrenchd")"));
  CHECK_FALSE(has(alone[1], "SYSTEMD_WANTS"));
  const auto both = rules_of({named, profile("arm", Transport::hidraw, {{0x16c0, 0x0486}})});
  CHECK(both.size() == alone.size());
  CHECK(has(both[1], "SYSTEMD_WANTS"));
}

TEST_CASE("unusable and simulated devices have no rule", "[udev_rules]") {
  CHECK(rules_of({profile("touch", Transport::hidraw, {{0x2988, 0x0302}}),
                  profile("loopback", Transport::loopback, {{0x1209, 0x0009}})})
            .size() == 2);
}

TEST_CASE("every shipped profile has rules for each of its ids, and none is open to all", "[udev_rules]") {
  REQUIRE(kShipped.rejected.empty());
  const std::string text = udev_rules(kShipped.profiles);
  int ids = 0;
  for (const DeviceProfile& shipped : kShipped.profiles) {
    if (shipped.transport == Transport::loopback) continue;
    for (const auto* list : {&shipped.match.usb, &shipped.match.usb_by_layout})
      for (const UsbId id : *list) {
        char name[16];
        std::snprintf(name, sizeof(name), "# %04x:%04x:", id.vendor, id.product);
        INFO(shipped.name << " " << name);
        const std::size_t at = text.find(name);
        REQUIRE(at != std::string::npos);
        const std::string block = text.substr(at, text.find("\n\n", at) - at);
        CHECK(has(block.substr(0, block.find('\n')), " " + shipped.name));
        CHECK(has(block, shipped.transport == Transport::libusb ? "DEVTYPE}==\"usb_device\", ATTR{idVendor}"
                                                                : "SUBSYSTEM==\"hidraw\""));
        CHECK(has(block, R"(GROUP="wrenchd", MODE="0660")"));
        CHECK(has(block, R"(ATTR{power/control}="on")"));
        ++ids;
      }
  }
  CHECK(ids > 20);
  CHECK_FALSE(has(text, "0666"));
  CHECK_FALSE(has(text, R"(TAG+="uaccess")"));
}

TEST_CASE("a vendor whose devices match by layout gets access, and nothing else", "[udev_rules]") {
  const std::string text = udev_rules(kShipped.profiles);
  const std::size_t at = text.find("# other devices of 256f, by report descriptor:");
  REQUIRE(at != std::string::npos);
  const std::string block = text.substr(at, text.find("\n\n", at) - at);
  CHECK(has(block, " spacemouse_split"));
  CHECK(has(block, R"(SUBSYSTEM=="hidraw", KERNELS=="*:256F:*", GROUP="wrenchd", MODE="0660")"));
  CHECK_FALSE(has(block, "LIBINPUT"));
  CHECK_FALSE(has(block, "SYSTEMD"));
}

TEST_CASE("wrenchctl udev-rules: each profile adds a rule, and an invalid profile is an error",
          "[udev_rules][wrenchctl]") {
  const TemporaryDirectory dir;
  dir.write("profiles/mine.toml",
            "inherits = \"reference_full_speed\"\nname = \"mine\"\n[match]\nusb = [\"1209:0042\"]\n");
  dir.write("profiles/reference_full_speed.toml", "");
  std::filesystem::remove(dir.path() / "profiles/reference_full_speed.toml");
  std::filesystem::copy(test::source_path("config/profiles/reference_full_speed.toml"),
                        dir.path() / "profiles");
  std::filesystem::copy(test::source_path("config/profiles/loopback.toml"), dir.path() / "profiles");
  const ProgramResult good = run_program("wrenchctl", {"udev-rules", "--from", dir.path().string()});
  INFO(good.err);
  CHECK(good.exit_code == 0);
  CHECK(has(good.out, "# 1209:0001: reference_full_speed\n"));
  CHECK(has(good.out, "# 1209:0042: mine\n"));
  dir.write("profiles/bad.toml", "name = \"bad\"\nspeed = 3\n");
  const ProgramResult bad = run_program("wrenchctl", {"udev-rules", "--from", dir.path().string()});
  CHECK(bad.exit_code == 1);
  CHECK(bad.out == "");
  CHECK(has(bad.err, "bad.toml"));
}

TEST_CASE("a name that would begin a rule of its own makes no rules", "[udev_rules]") {
  for (const char* name : {"x\nRUN+=\"/bin/sh -c id\"", "x y", "", "a\"b"})
    CHECK_THROWS_AS(udev_rules(std::vector{profile(name, Transport::hidraw, {{0x1209, 1}})}),
                    std::invalid_argument);
}

}  // namespace
}  // namespace wrenchd::test_udev_rules
