// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// What the first byte of an input of fuzz_config makes of the rest.
enum class FileKind : std::uint8_t { settings, scene, profile, hand_script, calibration, sealed_calibration };
inline constexpr unsigned kFileKinds = 6;
/// The one mesh that lies beside the input.
inline constexpr const char* kMeshName = "cube.off";

}  // namespace wrenchd::test
