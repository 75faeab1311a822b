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

void require_known_format(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end())
    throw MeshError(file.string() + ": unknown mesh format '" + extension +
                    "'; save it as .off, .obj, .stl or .ply");
}

[[noreturn]] void reject(const std::filesystem::path& file, const FileError& error) {
  switch (error.problem()) {
    case FileProblem::missing:
      throw MeshError(file.string() + ": no such file; check the path");
    case FileProblem::too_large:
      throw MeshError(file.string() + ": is larger than 1 GiB; simplify the mesh");
    default:
      throw MeshError(file.string() + ": " + error.what());
  }
}

}  // namespace

MeshSource read_mesh_source(const std::filesystem::path& file, const FileScope& scope) {
  try {
    OpenedFile opened(file, scope);
    if (opened.size_bytes() == 0) throw MeshError(file.string() + ": is empty; export the mesh again");
    require_known_format(file);
    return {file, opened.read(kMaxFileBytes)};
  } catch (const FileError& error) {
    reject(file, error);
  }
}

PolygonSoup parse_mesh(MeshSource source) {
  const std::filesystem::path file = source.file;
  if (source.bytes.starts_with(kByteOrderMark)) source.bytes.erase(0, kByteOrderMark.size());
  const std::string extension = lower_extension(file);
  PolygonSoup soup = extension == ".off"   ? read_off(source)
                     : extension == ".obj" ? read_obj(std::move(source))
                     : extension == ".stl" ? read_stl(source)
                                           : read_ply(source);
  if (soup.faces.empty()) throw MeshError(file.string() + ": has no faces; a tool needs a closed surface");
  return soup;
}

}  // namespace wrenchd
