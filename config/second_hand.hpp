// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "config/setting_table.hpp"
#include "config/settings.hpp"
#include "config/toml_reader.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// The second hand of a process, [[hand]] of wrenchd.toml: a device of its own in the scene of the first
/// hand.
struct SecondHand {
  std::string name;                  ///< part of the names of its files, "left" in "control-left.sock"
  Settings settings;                 ///< those of the first hand; what [[hand]] states replaces them
  std::optional<ToolSettings> tool;  ///< empty: the tool of the scene
  bool names_profile = false;        ///< [[hand]] states the profile of the device
  SourceLocation location;           ///< place of [[hand]], for messages
};

/// Reads [[hand]] of a root table; returns nothing if there is none. Serial number and USB port name one
/// device, so they are never those of the first hand. first: the settings of the first hand. Rejects a third
/// hand, and settings that two hands exclude. Not RT-safe: accesses files.
std::optional<SecondHand> read_second_hand(TomlTable& root, const SettingContext& context,
                                           const Settings& first);

}  // namespace wrenchd
