// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

namespace wrenchd {

/// Returns the last line of --help, which names the guides and the API references that exist; "" if none
/// exist. share: the share directory of the installation, with doc/wrenchd and doc/wrenchd-doc. source: the
/// source tree, whose README.md counts if no guides are installed; may be empty. Not RT-safe: accesses files.
std::string guide_line(const std::filesystem::path& share, const std::filesystem::path& source);

/// Returns the footer of a help text with the line for the running program below it: share is beside the
/// directory of the program, and source is the tree of the build unless WRENCHD_SEARCH_SOURCE=OFF.
std::string with_guide_line(const std::string& footer);

}  // namespace wrenchd
