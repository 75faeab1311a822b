// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd::test {

/// A box of six outward quads. Bits 0, 1 and 2 of the vertex index select the upper bound in x, y and z.
inline PolygonSoup box(const Vector3d& low, const Vector3d& high) {
  PolygonSoup soup;
  for (unsigned i = 0; i < 8; ++i)
    soup.vertices.emplace_back((i & 1u) ? high.x() : low.x(), (i & 2u) ? high.y() : low.y(),
                               (i & 4u) ? high.z() : low.z());
  soup.faces = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  return soup;
}

/// Splits each polygon into a fan of triangles.
inline PolygonSoup triangulated(const PolygonSoup& soup) {
  PolygonSoup out{soup.vertices, {}};
  for (const auto& face : soup.faces)
    for (std::size_t i = 1; i + 1 < face.size(); ++i) out.faces.push_back({face[0], face[i], face[i + 1]});
  return out;
}

inline PolygonSoup inside_out(PolygonSoup soup) {
  for (auto& face : soup.faces) std::reverse(face.begin(), face.end());
  return soup;
}

/// Combines two soups without shared vertices.
inline PolygonSoup concatenated(PolygonSoup a, const PolygonSoup& b) {
  const std::size_t first = a.vertices.size();
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (auto face : b.faces) {
    for (std::size_t& v : face) v += first;
    a.faces.push_back(face);
  }
  return a;
}

inline std::string number_text(double x) {
  std::ostringstream text;
  text.precision(17);
  text << x;
  return text.str();
}

inline std::string point_text(const Vector3d& p) {
  return number_text(p.x()) + " " + number_text(p.y()) + " " + number_text(p.z());
}

/// Returns "0 1 2" with `first` added to each index.
inline std::string indices_text(const std::vector<std::size_t>& face, std::size_t first) {
  std::string text;
  for (const std::size_t v : face) text += " " + std::to_string(v + first);
  return text;
}

inline std::string as_off(const PolygonSoup& soup) {
  std::string text =
      "OFF\n" + std::to_string(soup.vertices.size()) + " " + std::to_string(soup.faces.size()) + " 0\n";
  for (const Vector3d& p : soup.vertices) text += point_text(p) + "\n";
  for (const auto& face : soup.faces) text += std::to_string(face.size()) + indices_text(face, 0) + "\n";
  return text;
}

inline std::string as_obj(const PolygonSoup& soup) {
  std::string text = "# box\no box\n";
  for (const Vector3d& p : soup.vertices) text += "v " + point_text(p) + "\n";
  for (const auto& face : soup.faces) text += "f" + indices_text(face, 1) + "\n";
  return text;
}

/// Precondition: all faces are triangles.
inline std::string as_ascii_stl(const PolygonSoup& soup) {
  std::string text = "solid box\n";
  for (const auto& face : soup.faces) {
    text += " facet normal 0 0 0\n  outer loop\n";
    for (const std::size_t v : face) text += "   vertex " + point_text(soup.vertices[v]) + "\n";
    text += "  endloop\n endfacet\n";
  }
  return text + "endsolid box\n";
}

template <typename T>
void append_bytes(std::string& text, T x, bool swapped = false) {
  std::array<char, sizeof x> bytes;
  std::memcpy(bytes.data(), &x, sizeof x);
  if (swapped) std::reverse(bytes.begin(), bytes.end());
  text.append(bytes.data(), bytes.size());
}

/// Precondition: all faces are triangles. Assumes a little-endian machine, as the format is little-endian.
inline std::string as_binary_stl(const PolygonSoup& soup, const std::string& title = "box") {
  std::string text = title;
  text.resize(80, '\0');
  append_bytes(text, static_cast<std::uint32_t>(soup.faces.size()));
  for (const auto& face : soup.faces) {
    for (int i = 0; i < 3; ++i) append_bytes(text, 0.0f);
    for (const std::size_t v : face)
      for (int i = 0; i < 3; ++i) append_bytes(text, static_cast<float>(soup.vertices[v][i]));
    append_bytes(text, std::uint16_t{0});
  }
  return text;
}

inline std::string ply_header(const PolygonSoup& soup, const std::string& format,
                              const std::string& number = "double", const std::string& list = "uchar int") {
  return "ply\nformat " + format + " 1.0\ncomment box\nelement vertex " +
         std::to_string(soup.vertices.size()) + "\nproperty " + number + " x\nproperty " + number +
         " y\nproperty " + number + " z\nelement face " + std::to_string(soup.faces.size()) +
         "\nproperty list " + list + " vertex_indices\nend_header\n";
}

inline std::string ply_body(const PolygonSoup& soup) {
  std::string text;
  for (const Vector3d& p : soup.vertices) text += point_text(p) + "\n";
  for (const auto& face : soup.faces) text += std::to_string(face.size()) + indices_text(face, 0) + "\n";
  return text;
}

inline std::string as_ascii_ply(const PolygonSoup& soup) {
  return ply_header(soup, "ascii") + ply_body(soup);
}

inline std::string as_binary_ply(const PolygonSoup& soup, bool big_endian = false) {
  std::string text = ply_header(soup, big_endian ? "binary_big_endian" : "binary_little_endian");
  for (const Vector3d& p : soup.vertices)
    for (int i = 0; i < 3; ++i) append_bytes(text, p[i], big_endian);
  for (const auto& face : soup.faces) {
    append_bytes(text, static_cast<std::uint8_t>(face.size()));
    for (const std::size_t v : face) append_bytes(text, static_cast<std::int32_t>(v), big_endian);
  }
  return text;
}

}  // namespace wrenchd::test
