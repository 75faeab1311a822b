// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/mesh_file.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/polygon_soup_io.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>

namespace wrenchd {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

constexpr std::array<const char*, 4> kExtensions = {".off", ".obj", ".stl", ".ply"};

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
  const std::string extension = lower_extension(file);
  if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end())
    throw MeshError(file.string() + ": unknown mesh format '" + extension +
                    "'; save it as .off, .obj, .stl or .ply");
}

bool read_soup(const std::filesystem::path& file, std::vector<Point>& points,
               std::vector<std::vector<std::size_t>>& faces) {
  const std::string name = file.string();
  const std::string extension = lower_extension(file);
  if (extension == ".off") return CGAL::IO::read_OFF(name, points, faces);
  if (extension == ".obj") return CGAL::IO::read_OBJ(name, points, faces);
  if (extension == ".ply") return CGAL::IO::read_PLY(name, points, faces);
  return CGAL::IO::read_STL(name, points, faces);
}

}  // namespace

PolygonSoup read_mesh_file(const std::filesystem::path& file) {
  require_readable(file);
  std::vector<Point> points;
  PolygonSoup soup;
  bool read = false;
  try {
    read = read_soup(file, points, soup.faces);
  } catch (const std::exception&) {
    read = false;  // a reader that threw has not read
  }
  const std::string format = lower_extension(file).substr(1);
  if (!read)
    throw MeshError(file.string() + ": is not a readable " + format +
                    " file, or it ends too early; export the mesh again, or check counts and numbers by hand");
  if (soup.faces.empty()) throw MeshError(file.string() + ": has no faces; a tool needs a closed surface");
  if (format == "stl") CGAL::Polygon_mesh_processing::merge_duplicate_points_in_polygon_soup(points, soup.faces);
  soup.vertices.reserve(points.size());
  for (const Point& p : points) soup.vertices.emplace_back(p.x(), p.y(), p.z());
  return soup;
}

}  // namespace wrenchd
