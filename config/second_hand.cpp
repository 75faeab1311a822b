// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/second_hand.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "config/load_scene.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kLongestName = 32;

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/// A name of digits could be taken for the number that files of the flight recorder have, so a name begins
/// with a letter.
bool is_name(const std::string& name) {
  const auto good = [](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '_'; };
  return !name.empty() && name.size() <= kLongestName && is_letter(name.front()) &&
         std::all_of(name.begin(), name.end(), good);
}

void read_hand(TomlTable& table, const SettingContext& context, SecondHand& hand) {
  const TomlValue name = table.mandatory("name");
  if (name.text(hand.name) && !is_name(hand.name))
    name.reject("is part of file names: expected a letter, then letters, digits, - and _, at most " +
                std::to_string(kLongestName) + " in all, found \"" + printable(hand.name) + '"');
  hand.names_profile = table.optional("device").has("profile");
  read_hand_settings(table, context, hand.settings);
  if (const TomlValue scene = table.optional("scene"))
    scene.reject("applies to both hands; state it outside of [[hand]]");
  table.optional("tool").table([&](TomlTable& tool) { read_tool(tool, context.file, hand.tool.emplace()); });
}

}  // namespace

std::optional<SecondHand> read_second_hand(TomlTable& root, const SettingContext& context,
                                           const Settings& first) {
  const std::vector<TomlValue> hands = root.optional("hand").elements("a table headed [[hand]]");
  if (hands.empty()) return {};
  if (hands.size() > 1)
    hands[1].reject(
        "is a third hand, and one process has two: that of the file and that of one [[hand]]; remove it, or "
        "start another wrenchd with a file of its own");
  SecondHand hand{.name = {}, .settings = first, .tool = {}, .location = hands[0].location()};
  hand.settings.device.serial.clear();
  hand.settings.device.usb_port.clear();
  hands[0].table(read_hand, context, hand);
  if (first.servo.pacing == Pacing::device)
    hands[0].reject(
        "excludes [servo] pacing = \"device\": one thread serves both hands, by the clock; set pacing = "
        "\"clock\", or remove [[hand]]");
  return hand;
}

}  // namespace wrenchd
