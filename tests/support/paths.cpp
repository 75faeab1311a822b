// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/paths.hpp"

namespace wrenchd::test {
namespace {

std::string joined(std::string folder, std::string_view rest) {
  if (!rest.empty()) folder.append("/").append(rest);
  return folder;
}

}  // namespace

// Only this file is compiled with the folders of the build. All other objects are equal in each clone, so
// that ccache finds them.
std::string source_path(std::string_view in_source) {
  return joined(WRENCHD_SOURCE_DIR, in_source);
}
std::string program_path(std::string_view name) {
  return joined(WRENCHD_BINARY_DIR, name);
}

}  // namespace wrenchd::test
