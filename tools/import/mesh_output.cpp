// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/mesh_output.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <sstream>

#include "collision/meshes/make_mesh.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

std::string extension_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

template <class T>
void append(std::string& bytes, T x) {
  bytes.append(reinterpret_cast<const char*>(&x), sizeof x);
}

void append_floats(std::string& bytes, const Vector3d& v) {
  for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(v[k]));
}

std::string stl_bytes(const TriangleMesh& mesh, const std::string& statement) {
  constexpr std::size_t kHeader = 80, kTriangle = 50;
  std::string bytes = statement.substr(0, kHeader - 1);
  bytes.resize(kHeader, '\0');
  bytes.reserve(kHeader + 4 + kTriangle * mesh.triangles.size());
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices_m[t[0]];
    const Vector3d n = (mesh.vertices_m[t[1]] - a).cross(mesh.vertices_m[t[2]] - a);
    append_floats(bytes, n.norm() > 0.0 ? Vector3d(n.normalized()) : Vector3d(Vector3d::Zero()));
    for (const std::uint32_t v : t) append_floats(bytes, mesh.vertices_m[v]);
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

std::string off_text(const TriangleMesh& mesh, const std::string& statement) {
  std::ostringstream out;
  write_off(out, mesh);
  std::string text = out.str();
  return text.insert(text.find('\n') + 1, "# " + statement + "\n");
}

std::string ply_bytes(const TriangleMesh& mesh, const std::string& statement) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment " + statement + "\nelement vertex " +
                      std::to_string(mesh.vertices_m.size()) +
                      "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                      std::to_string(mesh.triangles.size()) +
                      "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vector3d& p : mesh.vertices_m)
    for (int k = 0; k < 3; ++k) append(bytes, p[k]);
  for (const auto& t : mesh.triangles) {
    append(bytes, std::uint8_t{3});
    for (const std::uint32_t v : t) append(bytes, static_cast<std::int32_t>(v));
  }
  return bytes;
}

/// OFF without its first lines has the vertices and faces in the shortest exact text.
std::string obj_text(const TriangleMesh& mesh, const std::string& statement) {
  std::ostringstream off;
  write_off(off, mesh);
  std::istringstream lines(off.str());
  std::string line, text = "# " + statement + "\n";
  std::getline(lines, line);
  std::getline(lines, line);
  for (std::size_t i = 0; i < mesh.vertices_m.size() && std::getline(lines, line); ++i)
    text += "v " + line + "\n";
  for (const auto& t : mesh.triangles)
    text += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " +
            std::to_string(t[2] + 1) + "\n";
  return text;
}

}  // namespace

void require_mesh_extension(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  for (const char* known : {".stl", ".off", ".ply", ".obj"})
    if (extension == known) return;
  throw ImportError("no format to write has the extension '" + printable_name(extension) +
                    "'; name a .stl, .off, .ply or .obj file, or a .toml scene");
}

bool has_single_precision(const std::filesystem::path& file) {
  return extension_of(file) == ".stl";
}

double rounding_mm(const TriangleMesh& mesh_mm, const std::filesystem::path& file) {
  if (!has_single_precision(file)) return 0.0;
  double largest = 0.0;
  for (const Vector3d& p : mesh_mm.vertices_m)
    largest = std::max(largest, (p - p.cast<float>().cast<double>()).norm());
  return largest;
}

std::string mesh_file_text(const TriangleMesh& mesh_mm, const std::filesystem::path& file,
                           const std::string& statement) {
  const std::string extension = extension_of(file);
  return extension == ".stl"   ? stl_bytes(mesh_mm, statement)
         : extension == ".ply" ? ply_bytes(mesh_mm, statement)
         : extension == ".obj" ? obj_text(mesh_mm, statement)
                               : off_text(mesh_mm, statement);
}

}  // namespace wrenchd
