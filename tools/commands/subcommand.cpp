// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/commands/subcommand.hpp"

#include <cstdio>

#include "collision/meshes/mesh_cache.hpp"
#include "collision/meshes/mesh_loader.hpp"

namespace wrenchd {

void print_note(const std::string& text) {
  std::fprintf(stderr, "wrenchctl: %s\n", text.c_str());
}

MeshLoader make_mesh_loader() {
  return {cache_directory(), print_note};
}

}  // namespace wrenchd
