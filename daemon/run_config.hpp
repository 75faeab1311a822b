// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "config/settings.hpp"
#include "config/toml_file.hpp"
#include "core/device_profile.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// The checked content of all configuration files, before any part is built from it.
struct RunConfig {
  Settings settings;
  DeviceProfile profile;  ///< the name is empty if the connected device decides
  SceneSettings scene;
  bool simulated = true;  ///< true: wrenchd simulates a device with this profile; false: a real device
  /// files of the profile as they were read, the nearest first; empty: not from files
  std::vector<ConfigText> profile_texts = {};
};

}  // namespace wrenchd
