// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

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
  LoadedTexts texts;      ///< texts of the configuration files as they were read
  bool simulated = true;  ///< true: wrenchd simulates a device with this profile; false: a real device
};

}  // namespace wrenchd
