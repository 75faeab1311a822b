// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/off_reader.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {
namespace {

using Words = std::vector<std::string_view>;

/// The variant that the first word of an OFF file declares.
struct OffVariant {
  std::size_t coordinates = 3;  ///< numbers before any colour: 3, or 6 with normals
  bool colours = false;

  /// A colour has three or four numbers.
  bool allows(std::size_t extra) const { return !colours || extra == 0 || extra == 3 || extra == 4; }
};

OffVariant variant_of(const MeshSource& source, std::size_t line, std::string_view word) {
  if (word == "OFF") return {};
  if (word == "COFF") return {3, true};
  if (word == "NOFF") return {6, false};
  if (word == "CNOFF") return {6, true};
  source.reject(line, "expected OFF (or COFF, NOFF, CNOFF), found " + quote_word(word) +
                          "; save the mesh as a plain OFF");
}

struct OffCounts {
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

/// Reads "vertices faces edges" behind the keyword or on the next line. Each vertex and each face occupies at
/// least one line of two bytes, which bounds both counts.
OffCounts read_counts(const MeshSource& source, LineReader& lines, Words words) {
  words.erase(words.begin());
  if (words.empty()) lines.next_words(words);
  std::size_t counts[2] = {0, 0};
  if (words.size() != 3)
    source.reject(lines.number(),
                  "expected the three counts of vertices, faces and edges; save the mesh as ASCII OFF");
  for (std::size_t i = 0; i < 3; ++i) {
    const auto count = parse_integer(words[i]);
    if (!count || *count < 0 || (i == 2 && *count > INT32_MAX))
      source.reject(lines.number(),
                    "expected a count, found " + quote_word(words[i]) + "; save the mesh as ASCII OFF");
    if (i < 2) counts[i] = static_cast<std::size_t>(*count);
  }
  if (counts[0] + counts[1] > source.bytes.size() / 2)
    source.reject(lines.number(), "declares " + std::to_string(counts[0]) + " vertices and " +
                                      std::to_string(counts[1]) +
                                      " faces, more than the file can hold; correct the counts");
  return {counts[0], counts[1]};
}

[[noreturn]] void reject_short(const MeshSource& source, const std::string& what, std::size_t count) {
  source.reject(0, "ends before " + what + " of " + std::to_string(count) +
                       "; the file is truncated or its counts are wrong: export the mesh again");
}

void read_vertices(const MeshSource& source, LineReader& lines, const OffVariant& variant, std::size_t count,
                   PolygonSoup& soup) {
  Words words;
  std::size_t width = 0;
  for (std::size_t v = 0; v < count; ++v) {
    const std::string what = "vertex " + std::to_string(v);
    if (!lines.next_words(words)) reject_short(source, what, count);
    if (words.size() < variant.coordinates)
      source.reject(lines.number(), what + ": expected " + std::to_string(variant.coordinates) +
                                        " numbers, found " + std::to_string(words.size()) +
                                        "; export the mesh again");
    if (v == 0) width = words.size();
    if (!variant.allows(words.size() - variant.coordinates) || (variant.colours && words.size() != width))
      source.reject(lines.number(),
                    what + ": a colour has 3 or 4 numbers, at every vertex or at none; save without colours");
    const auto [x, y, z] = require_point(source, lines.number(), words, 0, what);
    for (std::size_t i = 3; i < (variant.colours ? words.size() : variant.coordinates); ++i)
      require_number(source, lines.number(), words[i], what);
    soup.vertices.emplace_back(x, y, z);
  }
}

/// Appends the words of the following lines until a face has `width` words, because a face may occupy several
/// lines.
void join_lines(LineReader& lines, std::size_t width, Words& words) {
  Words more;
  while (words.size() < width && lines.next_words(more)) words.insert(words.end(), more.begin(), more.end());
}

void read_faces(const MeshSource& source, LineReader& lines, const OffVariant& variant,
                const OffCounts& counts, PolygonSoup& soup) {
  Words words;
  std::size_t colour_width = 0;
  for (std::size_t f = 0; f < counts.faces; ++f) {
    const std::string what = "face " + std::to_string(f);
    if (!lines.next_words(words)) reject_short(source, what, counts.faces);
    const std::size_t line = lines.number();
    const auto corners = parse_integer(words[0]);
    // A polygon has at most all vertices as corners.
    if (corners && *corners >= 0 && static_cast<std::size_t>(*corners) <= counts.vertices)
      join_lines(lines, static_cast<std::size_t>(*corners) + 1, words);
    if (!corners || *corners < 0 || static_cast<std::size_t>(*corners) >= words.size())
      source.reject(line, what + ": " + quote_word(words[0]) + " corners declared, " +
                              std::to_string(words.size() - 1) + " numbers follow; export the mesh again");
    const std::size_t width = static_cast<std::size_t>(*corners) + 1;
    std::vector<std::size_t>& face = soup.faces.emplace_back();
    face.reserve(width - 1);
    for (std::size_t i = 1; i < width; ++i) {
      const auto v = parse_integer(words[i]);
      if (!v || *v < 0 || static_cast<std::size_t>(*v) >= counts.vertices)
        source.reject(line, what + ": there is no vertex " + quote_word(words[i]) + "; there are " +
                                std::to_string(counts.vertices) + ", numbered from 0: export the mesh again");
      face.push_back(static_cast<std::size_t>(*v));
    }
    if (f == 0) colour_width = words.size() - width;
    if (!variant.allows(words.size() - width) || (variant.colours && words.size() - width != colour_width))
      source.reject(line,
                    what + ": a colour has 3 or 4 numbers, at every face or at none; save without colours");
    if (!variant.colours) continue;
    for (std::size_t i = width; i < words.size(); ++i) require_number(source, line, words[i], what);
  }
}

/// Splits a keyword that is joined to the first count: "OFF8 6 0" becomes "OFF", "8", "6", "0".
void split_joined_keyword(Words& words) {
  constexpr std::string_view kKeyword = "OFF";
  const std::size_t end = words[0].find(kKeyword) + kKeyword.size();
  if (words[0].find(kKeyword) > 2 || end >= words[0].size()) return;
  if (words[0][end] < '0' || words[0][end] > '9') return;
  words.insert(words.begin() + 1, words[0].substr(end));
  words[0] = words[0].substr(0, end);
}

}  // namespace

PolygonSoup read_off(const MeshSource& source) {
  LineReader lines(source.bytes);
  Words words;
  if (!lines.next_words(words)) source.reject(0, "contains no mesh; export it again");
  split_joined_keyword(words);
  const OffVariant variant = variant_of(source, lines.number(), words[0]);
  const OffCounts counts = read_counts(source, lines, words);
  PolygonSoup soup;
  soup.vertices.reserve(counts.vertices);
  soup.faces.reserve(counts.faces);
  read_vertices(source, lines, variant, counts.vertices, soup);
  read_faces(source, lines, variant, counts, soup);
  if (lines.next_words(words))
    source.reject(lines.number(), "more lines than the counts declare, " + std::to_string(counts.vertices) +
                                      " vertices and " + std::to_string(counts.faces) +
                                      " faces; correct the counts");
  return soup;
}

}  // namespace wrenchd
