// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "config/search_path.hpp"
#include "tools/control_commands.hpp"

namespace wrenchd {

/// Kinds of names that completion_names() returns.
const std::vector<std::string>& completion_kinds();

/// Returns the names that the shell completion offers:
///
///   gallery, profiles, scenes      file names without .toml along the search path
///   faults, meshes, settings       names that are part of the program
///   values NAME                    the words that a setting accepts
///   methods, events, obstacles     names that a running daemon knows; none if no daemon responds
///
/// Throws std::runtime_error for another kind. Not RT-safe: reads directories, waits up to 0.5 s for the
/// daemon.
std::vector<std::string> completion_names(const std::string& kind, const std::string& name,
                                          const SearchPath& search, const ControlOptions& options);

}  // namespace wrenchd
