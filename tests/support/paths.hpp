// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

namespace wrenchd::test {

/// Returns the absolute path of a file in the source tree, for example of "config/meshes/cube.off".
std::string source_path(std::string_view in_source = {});

/// Returns the absolute path of a built program, for example of "wrenchctl".
std::string program_path(std::string_view name);

}  // namespace wrenchd::test
