// SPDX-License-Identifier: GPL-3.0-or-later
#include <optional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_settings.hpp"
#include "config/second_hand.hpp"
#include "daemon/runtime.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_second_hand {

namespace {

namespace fs = std::filesystem;
using test::TemporaryDirectory;

const fs::path kConfig = test::source_path("config");
const SearchPath kShipped({kConfig});

const std::string kLeft = "[[hand]]\nname = 'left'\n";

struct BothHands {
  Settings first;
  std::optional<SecondHand> second;
};

BothHands both_from(const std::string& text) {
  const TemporaryDirectory dir;
  BothHands both;
  both.first = load_settings(dir.write("wrenchd.toml", text), kShipped, &both.second);
  return both;
}

std::vector<RunConfig> hands_from(const std::string& text, const RunConfigFiles& files = {}) {
  const TemporaryDirectory dir;
  RunConfigFiles all = files;
  all.config = dir.write("wrenchd.toml", text);
  return load_run_configs(all, kShipped);
}

std::string rejection_of(const std::string& text, const RunConfigFiles& files = {}) {
  return test::rejection_message<ConfigError>([&] { hands_from(text, files); });
}

}  // namespace

TEST_CASE("a file without [[hand]] has one hand", "[second_hand]") {
  CHECK_FALSE(both_from("").second);
  const auto hands = hands_from("");
  REQUIRE(hands.size() == 1);
  CHECK_FALSE(hands[0].two_hands());
  CHECK(hands[0].hand().empty());
}

TEST_CASE("a second hand has its own sections, and otherwise the settings of the first", "[second_hand]") {
  const BothHands both = both_from(
      "[device]\nserial = 'A'\nusb_port = '3-1'\nbase_in_world = { position_m = [0.1, 0.2, 0.3], "
      "rotation_vector_rad = [0.0, 0.0, 0.5] }\n"
      "[limits]\nmax_force_N = 3.0\nsoft_start_s = 2.0\n[servo]\nrate_Hz = 2000\n" +
      kLeft +
      "[hand.device]\nserial = 'B'\nbase_in_world = { position_m = [0.0, 0.4, 0.0] }\n"
      "[hand.limits]\nmax_force_N = 1.0\n[hand.simulation]\nhandle_mass_kg = 0.3\n");
  REQUIRE(both.second);
  const Settings& second = both.second->settings;
  CHECK(both.second->name == "left");
  CHECK(second.device.serial == "B");
  CHECK(second.device.usb_port.empty());  // names one device, so it is never that of the first hand
  CHECK(second.device.base_in_world.position_m == Vector3d(0.0, 0.4, 0.0));
  CHECK(second.device.base_in_world.rotation_vector_rad == Vector3d(0.0, 0.0, 0.5));
  CHECK(second.limits.max_force_N == 1.0);
  CHECK(second.limits.soft_start_s == 2.0);
  CHECK(second.simulation.handle_mass_kg == 0.3);
  CHECK(second.simulation.hand_path.size() == both.first.simulation.hand_path.size());
  CHECK(second.servo.rate_Hz == 2000.0);
  CHECK_FALSE(both.second->tool);
  CHECK(both.first.device.serial == "A");
  CHECK(both.first.limits.max_force_N == 3.0);
}

TEST_CASE("a second hand has a path of its own", "[second_hand]") {
  const BothHands both = both_from(kLeft + "[hand.simulation]\nhand_script = 'hands/dominoes.toml'\n");
  REQUIRE(both.second);
  CHECK(both.second->settings.simulation.hand_script.filename() == "dominoes.toml");
  CHECK(both.second->settings.hand_script_text != both.first.hand_script_text);
}

TEST_CASE("a second hand has a tool of its own in the scene of the first", "[second_hand]") {
  const auto hands =
      hands_from(kLeft + "[hand.tool]\nmesh = { make = 'box', triangles = 12 }\nscale = 0.02\nmass = 0.7\n");
  REQUIRE(hands.size() == 2);
  CHECK(hands[0].hand().empty());
  CHECK(hands[1].hand() == "left");
  CHECK(hands[0].two_hands());
  CHECK(hands[0].scene.tool.mass_kg != 0.7);
  CHECK(hands[1].scene.tool.mass_kg == 0.7);
  CHECK(hands[1].scene.meshes.size() == hands[0].scene.meshes.size());
  // A recording has the text of the scene, so the text must have this tool.
  CHECK(hands[1].scene.text.find("mass = 0.7") != std::string::npos);
  CHECK(hands[1].settings.text == hands[0].settings.text);
}

TEST_CASE("a mesh of [hand.tool] starts at wrenchd.toml", "[second_hand]") {
  const TemporaryDirectory dir;
  const auto mesh = dir.write("ball.off", "");
  const auto file = dir.write("wrenchd.toml", kLeft + "[hand.tool]\nmesh = 'ball.off'\n");
  CHECK(load_run_configs({file, {}, {}, false}, kShipped).back().scene.tool.mesh == mesh);
}

TEST_CASE("the recording of each hand has a file of its own", "[second_hand]") {
  const auto hands = hands_from("[recording]\nfile = 'runs/a.h5'\n" + kLeft);
  CHECK(hands[0].settings.recording.file == "runs/a.h5");
  CHECK(hands[1].settings.recording.file == "runs/a-left.h5");
}

TEST_CASE("a profile of the command line replaces one that [[hand]] does not name", "[second_hand]") {
  const RunConfigFiles simulated = {{}, {}, "polhem", true};
  const auto same = hands_from(kLeft, simulated);
  CHECK(same[0].profile.name == "polhem");
  CHECK(same[1].profile.name == "polhem");
  CHECK(same[1].simulated);
  const auto own = hands_from(kLeft + "[hand.device]\nprofile = 'falcon'\n", simulated);
  CHECK(own[0].profile.name == "polhem");
  CHECK(own[1].profile.name == "falcon");
  CHECK(own[1].simulated);
}

TEST_CASE("an invalid second hand is rejected with location and remedy", "[second_hand]") {
  struct Bad {
    std::string text;
    std::string place;
    std::string cure;
  };
  const std::vector<Bad> table = {
      {"[[hand]]\n", ":1:1: ", "key 'hand[0].name' is missing; it has no default, so state it here"},
      {"[[hand]]\nname = ''\n",
       ":2:8: ", "expected a letter, then letters, digits, - and _, at most 32 in all"},
      {"[[hand]]\nname = '2'\n", ":2:8: ", "expected a letter"},
      {"[[hand]]\nname = 'a/b'\n", ":2:8: ", "found \"a/b\""},
      {"[[hand]]\nname = '" + std::string(33, 'a') + "'\n", ":2:8: ", "at most 32 in all"},
      {"[hand]\nname = 'left'\n", ":1:1: ", "expected a table headed [[hand]], found a table"},
      {kLeft + "[[hand]]\nname = 'right'\n", ":3:1: ", "is a third hand, and one process has two"},
      {"[servo]\npacing = 'device'\n" + kLeft, ":3:1: ", "set pacing = \"clock\", or remove [[hand]]"},
      {kLeft + "[hand.device]\nserail = 'x'\n",
       ":4:1: ", "key 'hand[0].device.serail' is not known; did you mean 'serial'?"},
      {kLeft + "[hand.limits]\nmax_force_N = -1\n", ":4:15: ", "expected a number from 0 to 200 N, found -1"},
      {kLeft + "[hand.rendering]\nplanes = 3\n",
       ":3:1: ", "applies to both hands; state it outside of [[hand]]"},
      {kLeft + "scene = 'a.toml'\n", ":3:9: ", "applies to both hands"},
      {kLeft + "[hand.devcie]\n", ":3:7: ", "key 'hand[0].devcie' is not known; did you mean 'device'?"},
      {kLeft + "[hand.tool]\nmesh = 'no.off'\n", ":4:8: ", "no such file"},
      {kLeft + "[hand.tool]\nmass = 1\n", ":3:1: ", "key 'hand[0].tool.mesh' is missing"},
      {kLeft + "[hand.simulation]\nhand_script = 'no.toml'\n", ":4:15: ", "no such file"}};
  for (const Bad& bad : table) {
    const std::string message = rejection_of(bad.text);
    INFO(bad.text << "\nexpected " << bad.place << " ... " << bad.cure << "\ngot " << message);
    CHECK(test::rejects_at(message, bad.place, bad.cure));
  }
}

TEST_CASE("two hands that may open the same device are rejected", "[second_hand]") {
  const std::string polhem = "[device]\nprofile = 'polhem'\n";
  const auto rejected = [](const std::string& text) {
    return test::rejects_at(rejection_of(text), ":",
                            "state serial or usb_port in [device] and in [hand.device]");
  };
  CHECK(rejected(polhem + kLeft));
  CHECK(rejected(polhem + "serial = 'A'\n" + kLeft));
  CHECK(rejected(polhem + kLeft + "[hand.device]\nserial = 'A'\n"));
  CHECK(rejected(polhem + "serial = 'A'\n" + kLeft + "[hand.device]\nserial = 'A'\n"));
  CHECK(rejected(polhem + kLeft + "[hand.device]\nprofile = 'auto'\n"));
  CHECK_FALSE(rejected(polhem + "serial = 'A'\n" + kLeft + "[hand.device]\nserial = 'B'\n"));
  CHECK_FALSE(rejected(polhem + "usb_port = '3-1'\n" + kLeft + "[hand.device]\nusb_port = '3-2'\n"));
  CHECK_FALSE(rejected(polhem + kLeft + "[hand.device]\nprofile = 'falcon'\n"));
  CHECK_FALSE(rejected(polhem + kLeft + "[hand.device]\nprofile = 'loopback'\n"));
  CHECK(rejection_of(polhem + kLeft, {{}, {}, "polhem", true}).empty());  // simulated
}

}  // namespace wrenchd::test_second_hand
