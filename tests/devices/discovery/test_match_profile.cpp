// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/discovery/unusable_devices.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_match_profile {

using Catch::Contains;

namespace {

const SearchPath kShipped({test::source_path("config")});

std::vector<DeviceProfile> shipped() {
  std::vector<DeviceProfile> profiles;
  for (const auto& file : profile_files(kShipped)) profiles.push_back(load_profile(file, kShipped));
  return profiles;
}

const std::vector<DeviceProfile> kProfiles = shipped();

DeviceIdentity identity(int vendor, int product, std::uint16_t page = 0x01, std::uint16_t usage = 0x08) {
  DeviceIdentity device;
  device.id = {static_cast<std::uint16_t>(vendor), static_cast<std::uint16_t>(product)};
  device.usage_page = page;
  device.usage = usage;
  return device;
}

DeviceIdentity falcon_identity() {
  DeviceIdentity falcon = identity(0x0403, 0xcb48);
  falcon.product = "FALCON HAPTIC";
  return falcon;
}

/// Returns the name of the matching profile, or the reason if there is none.
std::string matched(const DeviceIdentity& device, std::string_view named = {}) {
  const MatchResult result = match_profile(device, kProfiles, named);
  REQUIRE(result.rejections.size() == kProfiles.size());
  return result.profile ? kProfiles[*result.profile].name : result.rejection;
}

std::string why_not(const DeviceIdentity& device, const std::string& profile) {
  const auto found = std::find_if(kProfiles.begin(), kProfiles.end(),
                                  [&](const DeviceProfile& p) { return p.name == profile; });
  REQUIRE(found != kProfiles.end());
  return match_profile(device, kProfiles).rejections[static_cast<std::size_t>(found - kProfiles.begin())];
}

}  // namespace

TEST_CASE("each device of the table matches its profile", "[match_profile]") {
  for (const int pid : {0xc626, 0xc628, 0xc627, 0xc625, 0xc629, 0xc62b})
    CHECK(matched(identity(0x046d, pid)) == "spacemouse_split");
  CHECK(matched(identity(0x256f, 0xc635)) == "spacemouse_split");
  for (const int pid : {0xc62e, 0xc62f, 0xc631, 0xc632, 0xc633, 0xc638, 0xc63a, 0xc652})
    CHECK(matched(identity(0x256f, pid)) == "spacemouse_combined");
  CHECK(matched(identity(0x16c0, 0x0486, 0xffab, 0x0200), "polhem") == "polhem");
  CHECK(matched(identity(0x1234, 0x0006, 0xffab, 0x0200), "polhem_lpc1768") == "polhem_lpc1768");
  DeviceIdentity falcon = falcon_identity();
  falcon.usage_page.reset();
  falcon.usage.reset();
  CHECK(matched(falcon) == "falcon");
}

TEST_CASE("the report descriptor decides between split and combined, not the id", "[match_profile]") {
  DeviceIdentity by_hand =
      identity(0x046d, 0xc62b);  // has the id of a SpaceMouse Pro but uses the combined format
  by_hand.input_reports = {{1, 13}, {3, 5}};
  CHECK(matched(by_hand) == "spacemouse_combined");
  CHECK(why_not(by_hand, "spacemouse_split") ==
        "input report 1 of the device has 13 bytes, in the profile 7");
  by_hand.input_reports = {{1, 7}, {2, 7}, {3, 5}};
  CHECK(matched(by_hand) == "spacemouse_split");

  DeviceIdentity old = identity(0x046d, 0xc623);
  CHECK(matched(old).empty());
  CHECK_THAT(why_not(old, "spacemouse_split"), Contains("the report descriptor has not been read"));
  old.input_reports = {{1, 7}, {2, 7}};
  CHECK(matched(old) == "spacemouse_split");
  old.input_reports = {{1, 7}, {3, 7}};
  CHECK(matched(old).empty());
  CHECK(why_not(old, "spacemouse_split") ==
        "input report 2 of the profile is not in the device's report descriptor");
}

TEST_CASE("a device without report ids is matched by the length of its report", "[match_profile]") {
  DeviceIdentity polhem = identity(0x16c0, 0x0486, 0xffab, 0x0200);
  polhem.input_reports = {{0, 64}};
  CHECK(matched(polhem, "polhem") == "polhem");
  polhem.input_reports = {{0, 8}};
  CHECK(matched(polhem, "polhem").empty());
}

TEST_CASE("every profile that does not match has a reason", "[match_profile]") {
  const DeviceIdentity stranger = identity(0x1d50, 0x6018);
  const MatchResult result = match_profile(stranger, kProfiles);
  CHECK_FALSE(result.profile);
  CHECK(result.rejection.empty());
  for (const std::string& why : result.rejections) CHECK_FALSE(why.empty());
  CHECK(why_not(stranger, "falcon") == "its ids do not include 1d50:6018");
  CHECK(why_not(stranger, "loopback") == "it is for the simulated device");
  CHECK(why_not(identity(0x16c0, 0x0486, 0xff00, 1), "polhem") ==
        "the usage page is ff00, the profile requires ffab");
  CHECK(why_not(identity(0x16c0, 0x0486, 0xffab, 1), "polhem") ==
        "the usage is 0001, the profile requires 0200");
  DeviceIdentity unread;
  unread.id = {0x16c0, 0x0486};
  CHECK(why_not(unread, "polhem") == "the usage page is not known, the profile requires ffab");
}

TEST_CASE("a profile with shared ids is used only if the configuration names it", "[match_profile]") {
  const DeviceIdentity board = identity(0x16c0, 0x0486, 0xffab, 0x0200);
  CHECK(why_not(board, "woodenhaptics") == "it is used only if the configuration names it");
  CHECK(matched(board, "woodenhaptics") == "woodenhaptics");
  CHECK(matched(board, "falcon").empty());
}

TEST_CASE("a libusb profile matches one interface of a device", "[match_profile]") {
  DeviceIdentity falcon = falcon_identity();
  CHECK(matched(falcon) == "falcon");  // as far as it is known
  falcon.interface = 0;
  CHECK(matched(falcon) == "falcon");
  falcon.interface = 1;
  CHECK_THAT(why_not(falcon, "falcon"), Contains("uses interface 0") && Contains("this is 1"));
  DeviceIdentity polhem =
      identity(0x16c0, 0x0486, 0xffab, 0x0200);  // hidraw nodes are distinguished by usage
  polhem.interface = 3;
  CHECK(matched(polhem, "polhem") == "polhem");
}

TEST_CASE("unusable devices are rejected by name", "[match_profile]") {
  CHECK_THAT(matched(identity(0x2988, 0x0304)),
             Contains("3D Systems Touch (HID) (2988:0304)") && Contains("protocol is not public"));
  CHECK_THAT(matched(identity(0x2988, 0x0302)), Contains("Touch (USB)"));
  CHECK_THAT(matched(identity(0x0301, 0x2988)), Contains("Touch (USB)"));
  CHECK_THAT(matched(identity(0x1451, 0x0402)), Contains("Force Dimension"));
  CHECK_THAT(matched(identity(0x1451, 0x0301)), Contains("Force Dimension"));
  CHECK_THAT(matched(identity(0x16c0, 0x0483)), Contains("Haply Inverse3"));
  CHECK_THAT(matched(identity(0x2fe3, 0x0100)), Contains("VerseGrip"));
  for (const int pid :
       {0xc650, 0xc651, 0xc654, 0xc655, 0xc656, 0xc657, 0xc658, 0xc664, 0xc665, 0xc668, 0xc62c})
    CHECK_THAT(matched(identity(0x256f, pid)), Contains("no six-axis device"));
  CHECK(find_unusable_device({0x256f, 0xc652}) == nullptr);
  CHECK(find_unusable_device({0x256f, 0xc653}) == nullptr);
}

TEST_CASE("an unusable device stays rejected if a profile lists its id", "[match_profile]") {
  std::vector<DeviceProfile> profiles = {kProfiles.front()};
  profiles[0].transport = Transport::hidraw;
  profiles[0].match.usb = {{0x2988, 0x0304}};
  CHECK_FALSE(match_profile(identity(0x2988, 0x0304), profiles).profile);
}

TEST_CASE("two equal devices are distinguished by serial number", "[match_profile]") {
  DeviceProfile left = kProfiles.front();
  left.name = "left";
  left.transport = Transport::hidraw;
  left.match = {};
  left.match.usb = {{0x1209, 0x0007}};
  DeviceProfile right = left, any = left;
  left.match.serial = "A1";
  right.name = "right";
  right.match.serial = "B2";
  any.name = "any";
  const std::vector<DeviceProfile> profiles = {any, left, right};
  DeviceIdentity device = identity(0x1209, 0x0007);
  device.serial = "B2";
  CHECK(match_profile(device, profiles).profile == 2u);
  CHECK(match_profile(device, profiles).rejections[1] == "it is for serial number A1, not B2");
  device.serial = "C3";
  CHECK(match_profile(device, profiles).profile == 0u);
  device.serial.clear();
  CHECK(match_profile(device, profiles).profile == 0u);
  CHECK(match_profile(device, profiles).rejections[1] ==
        "it is for serial number A1, not a device without one");

  const std::vector<DeviceProfile> same = {any, any};
  CHECK_FALSE(match_profile(device, same).profile);
  CHECK_THAT(match_profile(device, same).rejection, Contains("several profiles match 1209:0007"));
}

// A wrong device must get no byte. A Polhem sends nothing before it is written to, so only a name can tell it
// from a stock Teensy with the same id, usage and report lengths.
TEST_CASE("a profile with a shared id matches only a device that is named", "[match_profile]") {
  DeviceIdentity teensy = identity(0x16c0, 0x0486, 0xffab, 0x0200);
  teensy.input_reports = {{0, 64}};
  teensy.serial = "12345";
  teensy.product = "Teensyduino RawHID";
  CHECK(matched(teensy).empty());
  CHECK_THAT(why_not(teensy, "polhem"), Contains("16c0:0486 is the id of every Teensy of PJRC") &&
                                            Contains("set profile = \"polhem\" in [device]"));
  CHECK(matched(teensy, "polhem") == "polhem");
  const MatchResult by_serial = match_profile(teensy, kProfiles, {}, true);
  REQUIRE(by_serial.profile);
  CHECK(kProfiles[*by_serial.profile].name == "polhem");

  std::vector<DeviceProfile> own(1, kProfiles[*by_serial.profile]);
  own[0].match.product = "Polhem";
  CHECK(match_profile(teensy, own).rejections[0] ==
        "it is for the product \"Polhem\", not \"Teensyduino RawHID\"");
  teensy.product = "Polhem";
  CHECK(match_profile(teensy, own).profile == 0u);
  own[0].match.product.clear();
  own[0].match.serial = "12345";
  CHECK(match_profile(teensy, own).profile == 0u);
}

TEST_CASE("a device that must be written to first is matched by more than its id", "[match_profile]") {
  DeviceIdentity falcon = falcon_identity();
  falcon.product = "FT232R USB UART";
  CHECK(matched(falcon).empty());
  DeviceProfile lock_step = kProfiles.front();
  lock_step.transport = Transport::hidraw;
  lock_step.has_output = true;
  lock_step.stream = StreamStyle::lock_step;
  lock_step.match = {};
  lock_step.match.usb = {{0x2341, 0x8036}};
  CHECK_THAT(match_profile(identity(0x2341, 0x8036), std::vector{lock_step}).rejections[0],
             Contains("sends nothing before wrenchd writes to it"));
}

TEST_CASE("any device of 3Dconnexion with six axes is a SpaceMouse", "[match_profile]") {
  for (const int pid : {0xc636, 0xc641, 0xc6ff}) {
    DeviceIdentity mouse = identity(0x256f, pid);
    CHECK(matched(mouse).empty());  // without its descriptor nothing is known
    mouse.input_reports = {{1, 13}, {3, 5}};
    CHECK(matched(mouse) == "spacemouse_combined");
    mouse.input_reports = {{1, 7}, {2, 7}, {3, 5}};
    CHECK(matched(mouse) == "spacemouse_split");
    mouse.usage = 0x06;  // a keyboard
    CHECK(matched(mouse).empty());
  }
  DeviceIdentity other = identity(0x1d50, 0xc636);
  other.input_reports = {{1, 13}};
  CHECK(matched(other).empty());
}

}  // namespace wrenchd::test_match_profile
