// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>

#include "daemon/runtime.hpp"

namespace wrenchd {

/// Feeds a recording through the servo loop again, and prints what it compared, and whether all bits are the
/// same or where the first differs. files: what it is replayed with; none: what is in the recording itself.
/// Returns whether all are the same. Throws as read_recording(), unpack_run_config(), load_run_config() and
/// replay().
bool replay_recording(const std::filesystem::path& file, const std::optional<RunConfigFiles>& files);

}  // namespace wrenchd
