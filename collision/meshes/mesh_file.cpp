// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <system_error>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/polygon_soup_io.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>

#include "collision/meshes/mesh_source.hpp"

namespace wrenchd {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

/// A tool of a million triangles has 50 MB as binary STL. Beyond this, somebody named the wrong file.
constexpr std::uintmax_t kLargestFile = std::uintmax_t{1} << 30;

constexpr std::array<const char*, 4> kExtensions = {".off", ".obj", ".stl", ".ply"};

/// What some editors put in front of a text.
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
  if (std::filesystem::file_size(file, error) > kLargestFile)
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

/// "OFF8 6 0", as a well-known collection of models has it.
void part_off_counts(std::string& bytes) {
  const std::size_t digit = bytes.find("OFF") + 3;
  if (bytes.find("OFF") <= 2 && digit < bytes.size() && bytes[digit] >= '0' && bytes[digit] <= '9')
    bytes.insert(digit, 1, ' ');
}

/// CGAL's readers are handed only what they can be trusted with (collision/meshes/mesh_source.hpp).
bool read_soup(MeshSource source, const std::string& extension, std::vector<Point>& points,
               std::vector<std::vector<std::size_t>>& faces) {
  const auto silent = CGAL::parameters::verbose(false);
  if (extension == ".off") part_off_counts(source.bytes);
  if (extension == ".off") validate_off(source);
  if (extension == ".ply") source.bytes = normalise_ply(std::move(source));
  if (extension == ".stl") source.bytes = normalise_stl(std::move(source));
  if (extension == ".obj") source.bytes = normalise_obj(source);
  std::istringstream in(std::move(source.bytes));
  if (extension == ".off") return CGAL::IO::read_OFF(in, points, faces, silent);
  if (extension == ".ply") return CGAL::IO::read_PLY(in, points, faces, silent);
  if (extension == ".obj") return CGAL::IO::read_OBJ(in, points, faces, silent);
  return CGAL::IO::read_STL(in, points, faces, silent);
}

}  // namespace

MeshSource read_mesh_source(const std::filesystem::path& file) {
  require_readable(file);
  return read_bytes(file);
}

PolygonSoup read_mesh_file(const std::filesystem::path& file) {
  return parse_mesh(read_mesh_source(file));
}

PolygonSoup parse_mesh(MeshSource source) {
  const std::filesystem::path file = source.file;
  std::vector<Point> points;
  PolygonSoup soup;
  bool read = false;
  try {
    read = read_soup(std::move(source), lower_extension(file), points, soup.faces);
  } catch (const MeshError&) {
    throw;
  } catch (const std::exception&) {
    read = false;  // a reader that threw has not read
  }
  const std::string format = lower_extension(file).substr(1);
  if (!read)
    throw MeshError(
        file.string() + ": is not a readable " + format +
        " file, or it ends too early; export the mesh again, or check counts and numbers by hand");
  if (soup.faces.empty()) throw MeshError(file.string() + ": has no faces; a tool needs a closed surface");
  if (format == "stl")
    CGAL::Polygon_mesh_processing::merge_duplicate_points_in_polygon_soup(points, soup.faces);
  soup.vertices.reserve(points.size());
  for (const Point& p : points) soup.vertices.emplace_back(p.x(), p.y(), p.z());
  return soup;
}

}  // namespace wrenchd
