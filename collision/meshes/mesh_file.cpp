// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <string>
#include <utility>

#include "collision/meshes/obj_reader.hpp"
#include "collision/meshes/off_reader.hpp"
#include "collision/meshes/ply_reader.hpp"
#include "collision/meshes/stl_reader.hpp"

namespace wrenchd {
namespace {

/// A million triangles occupy 50 MB as binary STL. A larger file than this is probably not a mesh.
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;

constexpr std::array<const char*, 4> kExtensions = {".off", ".obj", ".stl", ".ply"};

/// Some editors write this before a text.
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

std::string read_bytes(const std::filesystem::path& file, const FileScope& scope) {
  try {
    return read_file(file, kMaxFileBytes, scope);
  } catch (const FileError& error) {
    switch (error.reason()) {
      case FileError::Reason::not_found:
        throw MeshError(file.string() + ": no such file; check the path in the scene");
      case FileError::Reason::directory:
      case FileError::Reason::not_regular:
        throw MeshError(file.string() + ": is not a file; name an OFF, OBJ, STL or PLY file");
      case FileError::Reason::too_large:
        throw MeshError(file.string() + ": is larger than 1 GiB; simplify the mesh");
      case FileError::Reason::unreadable:
        throw MeshError(file.string() + ": cannot be read; check the file and its permissions");
      case FileError::Reason::link:
      case FileError::Reason::outside:
        break;
    }
    throw MeshError(file.string() + ": " + error.what());
  }
}

void require_known_extension(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end())
    throw MeshError(file.string() + ": unknown mesh format '" + extension +
                    "'; save it as .off, .obj, .stl or .ply");
}

}  // namespace

MeshSource read_mesh_source(const std::filesystem::path& file, const FileScope& scope) {
  MeshSource source{file, read_bytes(file, scope)};
  if (source.bytes.empty()) throw MeshError(file.string() + ": is empty; export the mesh again");
  require_known_extension(file);
  return source;
}

PolygonSoup parse_mesh(MeshSource source) {
  if (source.bytes.starts_with(kByteOrderMark)) source.bytes.erase(0, kByteOrderMark.size());
  if (source.bytes.empty()) source.reject(0, "is empty; export the mesh again");
  const std::filesystem::path file = source.file;
  const std::string extension = lower_extension(file);
  PolygonSoup soup = extension == ".off"   ? read_off(source)
                     : extension == ".obj" ? read_obj(std::move(source))
                     : extension == ".stl" ? read_stl(source)
                                           : read_ply(source);
  if (soup.faces.empty()) throw MeshError(file.string() + ": has no faces; a tool needs a closed surface");
  return soup;
}

}  // namespace wrenchd
