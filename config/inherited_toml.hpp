// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "config/search_path.hpp"
#include "config/toml_file.hpp"

namespace wrenchd {

/// Adds to a table what only `parent` has. Tables merge key by key; every other value of `table` stays.
void merge_over(TomlNode::Table& table, TomlNode::Table parent);

/// Reads a profile and merges it over the profile that it names with `inherits = "NAME"`, recursively. Tables
/// merge key by key; every other value, arrays included, replaces the inherited one. The result has no key
/// `inherits`. Inherited values keep their file in their location.
///
/// NAME.toml is searched beside the file, then in profiles/ along the search path. Files already in the chain
/// are skipped, so /etc/wrenchd/profiles/x.toml may inherit the package's x. texts: if given, receives the
/// files as they were read, the nearest first. Throws ConfigError if a parent is missing or the chain is
/// cyclic, and what read_toml_file() throws. Not RT-safe: reads files.
TomlNode read_inherited(const std::filesystem::path& file, const SearchPath& search,
                        std::vector<ConfigText>* texts = nullptr);

}  // namespace wrenchd
