// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// Kind of file that fuzz_config reads the input as; selected by the first byte.
enum class FileKind : std::uint8_t {
  settings,
  scene,
  profile,
  hand_script,
  calibration,
  calibration_without_checksum
};
inline constexpr unsigned kFileKinds = 6;
/// Name of the only mesh file in the directory of the input.
inline constexpr const char* kMeshName = "cube.off";

}  // namespace wrenchd::test
