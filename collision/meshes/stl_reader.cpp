// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/stl_reader.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "collision/meshes/point_numbers.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kHeaderBytes = 80 + 4;
constexpr std::size_t kTriangleBytes = 50;  ///< normal and three corners as 12 floats, and an attribute

/// Collects triangles and gives equal vertices one index.
class TriangleCollector {
 public:
  /// triangles: expected number of triangles. A closed mesh has half as many vertices.
  explicit TriangleCollector(std::size_t triangles = 0) : numbers_(soup_.vertices, triangles / 2) {
    soup_.faces.reserve(triangles);
    soup_.vertices.reserve(triangles / 2);
  }
  TriangleCollector(const TriangleCollector&) = delete;  // numbers_ refers to soup_
  TriangleCollector& operator=(const TriangleCollector&) = delete;

  /// Returns the index of a vertex.
  std::size_t index_of(const std::array<double, 3>& p) {
    const Vector3d point(p[0], p[1], p[2]);
    const std::size_t number = numbers_.find_or_add(point, soup_.vertices.size());
    if (number == soup_.vertices.size()) soup_.vertices.push_back(point);
    return number;
  }
  void add(const std::array<std::size_t, 3>& triangle) {
    soup_.faces.emplace_back(triangle.begin(), triangle.end());
  }
  PolygonSoup take() { return std::move(soup_); }

 private:
  PolygonSoup soup_;
  PointNumbers numbers_;
};

/// Reads a value from any address.
template <typename T>
T value_at(const std::string& bytes, std::size_t offset) {
  T x;
  std::memcpy(&x, bytes.data() + offset, sizeof x);
  return x;
}

PolygonSoup read_binary(const MeshSource& source, std::size_t triangles) {
  TriangleCollector collector(triangles);
  for (std::size_t f = 0; f < triangles; ++f) {
    std::array<std::size_t, 3> triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      std::array<double, 3> p{};
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t offset = kHeaderBytes + kTriangleBytes * f + 4 * (3 + 3 * corner + d);
        p[d] = value_at<float>(source.bytes, offset);
        if (!is_finite(p[d]))
          source.reject(0, "face " + std::to_string(f) + ": corner " + std::to_string(corner) +
                               " is not a finite number; export the mesh again");
      }
      triangle[corner] = collector.index_of(p);
    }
    collector.add(triangle);
  }
  return collector.take();
}

bool is_word(std::string_view word, std::string_view lower_case) {
  return std::equal(word.begin(), word.end(), lower_case.begin(), lower_case.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

/// Reads the words of an ASCII STL file. Ignores normals, names and the difference of upper and lower case.
class AsciiReader {
 public:
  explicit AsciiReader(const MeshSource& source) : source_(source), lines_(source.bytes) {}

  PolygonSoup read() {
    for (std::vector<std::string_view> words; lines_.next_words(words);)
      for (std::size_t i = 0; i < words.size(); ++i) {
        // The last word of a truncated file may be incomplete. The end of the file then reports the problem.
        const bool is_last = i + 1 == words.size() && lines_.rest().empty();
        if (!accept(words[i], is_last)) break;
      }
    if (in_facet_ || in_solid_ || !has_solid_)
      source_.reject(0, "ends before 'endsolid'; the file is truncated: export the mesh again");
    return collector_.take();
  }

 private:
  /// Returns false if the rest of the line is a name.
  bool accept(std::string_view word, bool is_last) {
    if (numbers_ > 0) {
      accept_number(word);
    } else if (is_word(word, "vertex")) {
      numbers_ = 3;
    } else if (is_word(word, "facet")) {
      begin_facet();
    } else if (is_word(word, "outer")) {
      in_normal_ = false;
    } else if (is_word(word, "endfacet")) {
      end_facet();
    } else if (is_word(word, "solid")) {
      begin_solid();
      return false;
    } else if (is_word(word, "endsolid")) {
      if (!in_facet_) {
        in_solid_ = false;
        has_solid_ = true;
      }
      return false;
    } else if (!in_normal_ && !is_word(word, "endloop") && !is_word(word, "loop") && !is_last) {
      source_.reject(lines_.number(), quote_word(word) + " is no word of an STL file; export the mesh again");
    }
    return true;
  }

  void accept_number(std::string_view word) {
    const auto x = parse_number(word);
    if (!x)
      source_.reject(lines_.number(), "vertex: expected three finite numbers, found " + quote_word(word) +
                                          "; export the mesh again");
    point_[3 - numbers_] = *x;
    if (--numbers_ > 0) return;
    if (in_facet_ && corners_ < 3) triangle_[corners_] = collector_.index_of(point_);
    ++corners_;
  }

  void begin_solid() {
    if (in_facet_) return;
    if (in_solid_)
      source_.reject(lines_.number(),
                     "'solid' before the 'endsolid' of the previous one; export the mesh again");
    in_solid_ = true;
  }

  void begin_facet() {
    if (in_facet_ && corners_ > 0)
      source_.reject(lines_.number(),
                     "facet " + std::to_string(facets_) + " has no 'endfacet'; export the mesh again");
    in_facet_ = true;
    in_normal_ = true;
    corners_ = 0;
  }

  void end_facet() {
    if (corners_ != 3)
      source_.reject(lines_.number(), "facet " + std::to_string(facets_) + " has " +
                                          std::to_string(corners_) +
                                          " vertices, not three; export the mesh again");
    if (in_facet_) collector_.add(triangle_);
    in_facet_ = false;
    ++facets_;
  }

  const MeshSource& source_;
  LineReader lines_;
  TriangleCollector collector_;
  std::array<double, 3> point_{};
  std::array<std::size_t, 3> triangle_{};
  std::size_t facets_ = 0;   ///< number of complete facets
  std::size_t corners_ = 0;  ///< number of vertices since the last 'facet'
  std::size_t numbers_ = 0;  ///< number of coordinates of the present vertex that are still missing
  bool in_solid_ = false;
  bool has_solid_ = false;  ///< a solid is complete
  bool in_facet_ = false;
  bool in_normal_ = false;  ///< between 'facet' and 'outer'
};

}  // namespace

// A binary file may begin with "solid" too, so the size of the file decides between the two forms.
PolygonSoup read_stl(const MeshSource& source) {
  const std::size_t size = source.bytes.size();
  const std::size_t triangles = size < kHeaderBytes ? 0 : value_at<std::uint32_t>(source.bytes, 80);
  const std::size_t binary_size = kHeaderBytes + kTriangleBytes * triangles;
  if (size == binary_size) return read_binary(source, triangles);
  const auto start = source.bytes.find_first_not_of(" \t\r\n");
  if (start != std::string::npos && is_word(std::string_view(source.bytes).substr(start, 5), "solid"))
    return AsciiReader(source).read();
  if (size < kHeaderBytes) source.reject(0, "is too short for an STL file; export the mesh again");
  source.reject(0, "does not begin with 'solid', and a binary STL file of " + std::to_string(triangles) +
                       " triangles has " + std::to_string(binary_size) + " bytes, not " +
                       std::to_string(size) + ": it is truncated, or not an STL file; export the mesh again");
}

}  // namespace wrenchd
