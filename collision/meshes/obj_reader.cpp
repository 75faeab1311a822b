// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/obj_reader.hpp"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace wrenchd {
namespace {

using Words = std::vector<std::string_view>;

/// Returns the vertex number, from 0, of a face corner: "7", "7/1", "7//3" or "7/1/3". A negative number
/// counts back from the last vertex so far. Returns nothing for any other word.
std::optional<long long> parse_corner(std::string_view word, std::size_t vertices_so_far) {
  const auto v = parse_integer(word.substr(0, word.find('/')));
  if (!v || *v == 0) return {};
  return *v > 0 ? *v - 1 : *v + static_cast<long long>(vertices_so_far);
}

/// Replaces each backslash at the end of a line, and the line's end, by blanks. The line then continues in
/// the next one, and the bytes keep their positions.
void join_continued_lines(std::string& text) {
  for (std::size_t at = 0; (at = text.find('\\', at)) != std::string::npos; ++at) {
    const std::size_t end = at + 1 + (text.compare(at + 1, 1, "\r") == 0 ? 1 : 0);
    if (text.compare(end, 1, "\n") == 0)
      std::fill_n(text.begin() + static_cast<std::ptrdiff_t>(at), end - at + 1, ' ');
  }
}

bool is_statement(std::string_view word) {
  constexpr std::size_t kMaxLength = 12;
  return word.size() <= kMaxLength && std::all_of(word.begin(), word.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
         });
}

/// A face corner whose vertex does not exist yet. A face may precede its vertices, so the reader decides at
/// the end of the file.
struct PendingCorner {
  std::size_t line = 0, face = 0;
  std::string_view word;
  std::optional<long long> vertex;
};

void check_pending(const MeshSource& source, const std::vector<PendingCorner>& pending,
                   std::size_t vertices) {
  for (const PendingCorner& corner : pending)
    if (!corner.vertex || *corner.vertex < 0 || static_cast<std::size_t>(*corner.vertex) >= vertices)
      source.reject(corner.line, "face " + std::to_string(corner.face) + ": there is no vertex " +
                                     quote_word(corner.word) + "; there are " + std::to_string(vertices) +
                                     ", numbered from 1: export the mesh again");
}

void read_vertex(const MeshSource& source, std::size_t line, const Words& words, PolygonSoup& soup) {
  const std::string what = "vertex " + std::to_string(soup.vertices.size());
  if (words.size() < 4)
    source.reject(line, what + ": expected 3 numbers, found " + std::to_string(words.size() - 1) +
                            "; export the mesh again");
  const auto [x, y, z] = require_point(source, line, words, 1, what);
  soup.vertices.emplace_back(x, y, z);
}

void read_face(std::size_t line, const Words& words, PolygonSoup& soup, std::vector<PendingCorner>& pending) {
  std::vector<std::size_t>& face = soup.faces.emplace_back();
  face.reserve(words.size() - 1);
  for (std::size_t i = 1; i < words.size(); ++i) {
    const auto v = parse_corner(words[i], soup.vertices.size());
    if (!v || *v < 0 || static_cast<std::size_t>(*v) >= soup.vertices.size())
      pending.push_back({line, soup.faces.size() - 1, words[i], v});
    face.push_back(static_cast<std::size_t>(v.value_or(0)));
  }
}

}  // namespace

PolygonSoup read_obj(MeshSource source) {
  join_continued_lines(source.bytes);
  PolygonSoup soup;
  std::vector<PendingCorner> pending;
  LineReader lines(source.bytes);
  for (Words words; lines.next_words(words);) {
    if (!is_statement(words[0]))
      source.reject(lines.number(),
                    quote_word(words[0]) + " is no statement of an OBJ file; export the mesh again");
    if (words[0] == "v")
      read_vertex(source, lines.number(), words, soup);
    else if (words[0] == "f")
      read_face(lines.number(), words, soup, pending);
  }
  if (!soup.faces.empty() && soup.vertices.empty() && pending.empty())
    source.reject(0, "has no vertices; export the mesh again");
  check_pending(source, pending, soup.vertices.size());
  return soup;
}

}  // namespace wrenchd
