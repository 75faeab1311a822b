// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/scene_settings.hpp"

namespace wrenchd {

/// Returns a scene file with this content, for a scene that clients have changed. load_scene() reads the same
/// scene from it. An obstacle has the pose that it has at scene time now_s. A motion without end goes on from
/// there; a motion that ends, or has not begun, is left out. Not RT-safe: allocates.
std::string scene_text(const SceneSettings& scene, double now_s);

}  // namespace wrenchd
