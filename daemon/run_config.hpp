// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "config/settings.hpp"
#include "config/toml_file.hpp"
#include "core/device_profile.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// The checked content of all configuration files, before any part is built from it. Each of two hands in one
/// process has a run configuration of its own.
struct RunConfig {
  Settings settings;
  DeviceProfile profile;  ///< the name is empty if the connected device decides
  SceneSettings scene;
  bool simulated = true;  ///< true: wrenchd simulates a device with this profile; false: a real device
  /// files of the profile as they were read, the nearest first; empty: not from files
  std::vector<ConfigText> profile_texts = {};
  std::string second_hand = {};  ///< name of the second hand of the process; empty: there is one hand
  bool is_second = false;        ///< this is the run configuration of the second hand

  bool two_hands() const noexcept { return !second_hand.empty(); }
  /// Name of this hand in file names and log lines; empty: the first hand, which has none.
  std::string hand() const { return is_second ? second_hand : std::string(); }
};

}  // namespace wrenchd
