// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include "collision/meshes/obj_reader.hpp"
#include "collision/meshes/off_reader.hpp"
#include "collision/meshes/ply_reader.hpp"
#include "collision/meshes/stl_reader.hpp"

namespace wrenchd {
namespace {

/// A million triangles occupy 50 MB as binary STL. A larger file than this is probably not a mesh.
constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;

constexpr std::array<const char*, 4> kExtensions = {".off", ".obj", ".stl", ".ply"};

/// Some editors write this before a text.
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

void require_readable(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    throw MeshError(file.string() + ": no such file; check the path in the scene");
  if (!std::filesystem::is_regular_file(status))
    throw MeshError(file.string() + ": is not a file; name an OFF, OBJ, STL or PLY file");
  if (std::filesystem::file_size(file, error) == 0)
    throw MeshError(file.string() + ": is empty; export the mesh again");
  if (std::filesystem::file_size(file, error) > kMaxFileBytes)
    throw MeshError(file.string() + ": is larger than 1 GiB; simplify the mesh");
  const std::string extension = lower_extension(file);
  if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end())
    throw MeshError(file.string() + ": unknown mesh format '" + extension +
                    "'; save it as .off, .obj, .stl or .ply");
}

MeshSource read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  MeshSource source{file, {}};
  source.bytes.resize(std::filesystem::file_size(file));
  in.read(source.bytes.data(), static_cast<std::streamsize>(source.bytes.size()));
  if (!in || source.bytes.empty()) source.reject(0, "cannot be read; check the file and its permissions");
  if (source.bytes.starts_with(kByteOrderMark)) source.bytes.erase(0, kByteOrderMark.size());
  return source;
}

}  // namespace

MeshSource read_mesh_source(const std::filesystem::path& file) {
  require_readable(file);
  return read_bytes(file);
}

PolygonSoup parse_mesh(MeshSource source) {
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
