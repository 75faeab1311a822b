// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/settings.hpp"
#include "core/device_profile.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// What the files say, read and checked, before anything is built from it.
struct RunConfig {
  Settings settings;
  DeviceProfile profile;  ///< without a name where the settings leave it to the device that is plugged in
  SceneSettings scene;
  bool simulated = true;  ///< a simulated device speaks as the profile says; no other is opened
};

}  // namespace wrenchd
