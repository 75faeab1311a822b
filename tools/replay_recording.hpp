// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>

#include "daemon/runtime.hpp"

namespace wrenchd {

/// Replays a recording through the servo loop. Prints the number of compared ticks, and whether all bits are
/// equal or where the first difference is. files: configuration for the replay; empty: the configuration in
/// the recording. Returns true if all bits are equal. Throws the exceptions of read_recording(),
/// unpack_run_config(), load_run_config() and replay(). Not RT-safe: takes seconds for long recordings.
bool replay_recording(const std::filesystem::path& file, const std::optional<RunConfigFiles>& files);

}  // namespace wrenchd
