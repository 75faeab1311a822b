// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/files/opened_file.hpp"
#include "tools/import/imported_file.hpp"

namespace wrenchd {

/// Kind of file, by its extension.
enum class SourceKind { cad, mesh, urdf };

/// What to import from a file.
struct ImportJob {
  std::filesystem::path file;
  double chord_mm = 0.02;
  double unit_mm = 0.0;            ///< unit of a file that states none; 0: such a file is rejected
  bool unit_is_default = false;    ///< also accept mesh files that state their unit
  std::vector<std::string> parts;  ///< empty: all
  bool skip_surfaces = false;      ///< leave out faces that bound no solid
  std::size_t max_triangles = 2'000'000;
};

/// Returns the kind of a file. Throws ImportError, without the name of the file, if the extension is unknown.
/// Not RT-safe: allocates.
SourceKind source_kind(const std::filesystem::path& file);

/// Returns the bytes of a regular file, which is opened once. Throws ImportError, without the name of the
/// file. Not RT-safe: reads a file.
std::string read_source(const std::filesystem::path& file, const FileScope& scope = {});

/// Imports a CAD or mesh file. A foreign library reads it in a child process with limits. scope: where the
/// file and its companions may be. Throws ImportError, without the name of the file. Not RT-safe: may take
/// minutes.
ImportedFile import_file(const ImportJob& job, const FileScope& scope = {});

/// Returns the parts that a CAD or mesh file offers. Throws ImportError as import_file() does. Not RT-safe.
std::vector<PartSummary> list_parts(const ImportJob& job);

}  // namespace wrenchd
