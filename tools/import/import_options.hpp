// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace wrenchd {

/// The command line of wrenchd-import, which is also that of `wrenchctl import`.
struct ImportOptions {
  std::string file;
  std::string output;  ///< empty: only the report
  std::string chord;   ///< empty: kDefaultChord
  std::string unit;    ///< unit of a file that states none; empty: such a file is rejected
  std::vector<std::string> parts;
  std::vector<std::string> joints;    ///< "NAME=VALUE"
  std::vector<std::string> packages;  ///< "NAME=DIR"
  std::size_t max_triangles = 2'000'000;
  bool list = false;
  bool skip_surfaces = false;
  bool surface = false;
  bool unite = false;

  static constexpr const char* kDefaultChord = "0.02mm";
};

/// Adds the options to a command. options must outlive the parsing. Not RT-safe: allocates.
void add_import_options(CLI::App& command, ImportOptions& options);

/// Heading of the help.
inline constexpr const char* kImportDescription =
    "Convert a CAD file, mesh or robot description to meshes that wrenchd\n"
    "loads, with a measured chord error (package wrenchd-import)";

}  // namespace wrenchd
