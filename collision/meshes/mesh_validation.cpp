// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdint>
#include <cstring>

#include "collision/meshes/mesh_source.hpp"
#include "core/finite.hpp"

// OFF, OBJ and STL, as CGAL's readers understand them: a vertex or a face a line.

namespace wrenchd {
namespace {

using Words = std::vector<std::string_view>;

/// The next line with words on it.
bool next_words(LineReader& lines, Words& words) {
  for (std::string_view line; lines.next(line);)
    if (!(words = split_words(line)).empty()) return true;
  words.clear();
  return false;
}

void require_numbers(const MeshSource& source, std::size_t line, const Words& words, std::size_t first,
                     std::size_t last, const std::string& what) {
  for (std::size_t i = first; i < last; ++i)
    if (!parse_number(words[i]))
      source.reject(line, what + ": expected a finite number, found " + quote_word(words[i]) +
                              "; export the mesh again");
}

/// What the first word of an OFF file announces.
struct OffKind {
  std::size_t coordinates = 3;  ///< before any colour: with normals there are three more
  bool colours = false;

  /// Colours are three or four numbers. CGAL reads beyond a line that has another count, and wants what the
  /// first vertex (or face) has on all of them.
  bool allows(std::size_t extra) const { return !colours || extra == 0 || extra == 3 || extra == 4; }
};

OffKind off_kind(const MeshSource& source, std::size_t line, std::string_view word) {
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

/// "vertices faces edges", behind the keyword or on the next line. Every vertex and face has a line, hence
/// two bytes.
OffCounts off_counts(const MeshSource& source, LineReader& lines, Words words) {
  words.erase(words.begin());
  if (words.empty()) next_words(lines, words);
  std::size_t counts[2] = {0, 0};
  if (words.size() != 3)
    source.reject(lines.number(),
                  "expected the three counts of vertices, faces and edges; save the mesh as ascii OFF");
  for (std::size_t i = 0; i < 3; ++i) {
    const auto count = parse_integer(words[i]);
    if (!count || *count < 0 || (i == 2 && *count > INT32_MAX))
      source.reject(lines.number(),
                    "expected a count, found " + quote_word(words[i]) + "; save the mesh as ascii OFF");
    if (i < 2) counts[i] = static_cast<std::size_t>(*count);
  }
  if (counts[0] + counts[1] > source.bytes.size() / 2)
    source.reject(lines.number(), "announces " + std::to_string(counts[0]) + " vertices and " +
                                      std::to_string(counts[1]) +
                                      " faces, more than the file can hold; correct the counts");
  return {counts[0], counts[1]};
}

[[noreturn]] void refuse_short(const MeshSource& source, const std::string& what, std::size_t count) {
  source.reject(0, "ends before " + what + " of " + std::to_string(count) +
                       "; the file is cut short or its counts are wrong: export the mesh again");
}

void guard_off_vertices(const MeshSource& source, LineReader& lines, const OffKind& kind, std::size_t count) {
  Words words;
  std::size_t width = 0;
  for (std::size_t v = 0; v < count; ++v) {
    const std::string what = "vertex " + std::to_string(v);
    if (!next_words(lines, words)) refuse_short(source, what, count);
    if (words.size() < kind.coordinates)
      source.reject(lines.number(), what + ": expected " + std::to_string(kind.coordinates) +
                                        " numbers, found " + std::to_string(words.size()) +
                                        "; export the mesh again");
    if (v == 0) width = words.size();
    if (!kind.allows(words.size() - kind.coordinates) || (kind.colours && words.size() != width))
      source.reject(lines.number(),
                    what + ": a colour has 3 or 4 numbers, at every vertex or at none; save without colours");
    require_numbers(source, lines.number(), words, 0, kind.colours ? words.size() : kind.coordinates, what);
  }
}

void guard_off_faces(const MeshSource& source, LineReader& lines, const OffKind& kind,
                     const OffCounts& counts) {
  Words words;
  std::size_t colour = 0;
  for (std::size_t f = 0; f < counts.faces; ++f) {
    const std::string what = "face " + std::to_string(f);
    if (!next_words(lines, words)) refuse_short(source, what, counts.faces);
    const auto corners = parse_integer(words[0]);
    if (!corners || *corners < 0 || static_cast<std::size_t>(*corners) >= words.size())
      source.reject(lines.number(), what + ": " + quote_word(words[0]) + " corners announced, " +
                                        std::to_string(words.size() - 1) +
                                        " numbers follow; export the mesh again");
    const std::size_t width = static_cast<std::size_t>(*corners) + 1;
    for (std::size_t i = 1; i < width; ++i) {
      const auto v = parse_integer(words[i]);
      if (!v || *v < 0 || static_cast<std::size_t>(*v) >= counts.vertices)
        source.reject(lines.number(), what + ": there is no vertex " + quote_word(words[i]) + "; there are " +
                                          std::to_string(counts.vertices) +
                                          ", numbered from 0: export the mesh again");
    }
    if (f == 0) colour = words.size() - width;
    if (!kind.allows(words.size() - width) || (kind.colours && words.size() - width != colour))
      source.reject(lines.number(),
                    what + ": a colour has 3 or 4 numbers, at every face or at none; save without colours");
    if (kind.colours) require_numbers(source, lines.number(), words, width, words.size(), what);
  }
}

/// A corner of an OBJ face: "7", "7/1", "7//3", "7/1/3", and -1 for the last vertex so far. From 0; nothing
/// where it is none of these.
std::optional<long long> obj_corner(std::string_view word, std::size_t vertices_so_far) {
  auto v = parse_integer(word.substr(0, word.find('/')));
  if (!v || *v == 0) return {};
  return *v > 0 ? *v - 1 : *v + static_cast<long long>(vertices_so_far);
}

std::size_t count_obj_vertices(const MeshSource& source) {
  std::size_t count = 0;
  LineReader lines(source.bytes);
  for (Words words; next_words(lines, words);) count += words[0] == "v" ? 1 : 0;
  return count;
}

/// A line of an OBJ file that ends in a backslash goes on in the next.
MeshSource with_joined_lines(MeshSource source) {
  std::string& text = source.bytes;
  for (std::size_t at = 0; (at = text.find('\\', at)) != std::string::npos; ++at) {
    const std::size_t end = at + 1 + (text.compare(at + 1, 1, "\r") == 0 ? 1 : 0);
    if (text.compare(end, 1, "\n") == 0)
      std::fill_n(text.begin() + static_cast<std::ptrdiff_t>(at), end - at + 1, ' ');
  }
  return source;
}

bool obj_statement(std::string_view word) {
  constexpr std::size_t kLongest = 12;
  return word.size() <= kLongest && std::all_of(word.begin(), word.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
         });
}

void append_line(std::string& text, const Words& words) {
  for (std::size_t i = 0; i < words.size(); ++i) (text += i > 0 ? " " : "") += words[i];
  text += '\n';
}

/// Reads a value where it need not be aligned.
template <typename T>
T at(const std::string& bytes, std::size_t offset) {
  T x;
  std::memcpy(&x, bytes.data() + offset, sizeof x);
  return x;
}

constexpr std::size_t kStlHeader = 80 + 4;
constexpr std::size_t kStlTriangle = 50;  ///< normal, three corners, attribute: 12 floats and two bytes

void guard_binary_stl(const MeshSource& source, std::size_t triangles) {
  for (std::size_t f = 0; f < triangles; ++f)
    for (std::size_t i = 3; i < 12; ++i)
      if (!is_finite(at<float>(source.bytes, kStlHeader + kStlTriangle * f + 4 * i)))
        source.reject(0, "face " + std::to_string(f) + ": corner " + std::to_string(i / 3 - 1) +
                             " is not a finite number; export the mesh again");
}

bool is_word(std::string_view word, std::string_view lower_case) {
  return std::equal(word.begin(), word.end(), lower_case.begin(), lower_case.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

/// Whatever else is cut off, the last word may be, and is left to CGAL to miss.
std::string guarded_ascii_stl(const MeshSource& source) {
  std::string text;
  std::size_t facet = 0;
  int numbers = 0;  // still to come
  int corners = 0;
  bool normal = false;  // from "facet" to "outer": all numbers, and of no use
  LineReader lines(source.bytes);
  for (Words words; next_words(lines, words);) {
    for (std::size_t i = 0; i < words.size(); ++i) {
      const std::string_view word = words[i];
      const auto is = [&](std::string_view lower_case) { return is_word(word, lower_case); };
      if (numbers > 0) {
        if (!parse_number(word))
          source.reject(lines.number(), "vertex: expected three finite numbers, found " + quote_word(word) +
                                            "; export the mesh again");
        (text += ' ') += word;
        if (--numbers == 0) text += '\n';
      } else if (is("vertex")) {
        text += "vertex";
        numbers = 3;
        ++corners;
      } else if (is("facet")) {
        text += "facet normal 0 0 0\n";
        normal = true;
        corners = 0;
      } else if (is("outer")) {
        text += "outer loop\n";
        normal = false;
      } else if (is("endfacet")) {
        if (corners != 3)
          source.reject(lines.number(), "facet " + std::to_string(facet) + " has " + std::to_string(corners) +
                                            " vertices, not three; export the mesh again");
        text += "endfacet\n";
        ++facet;
      } else if (is("endloop")) {
        text += "endloop\n";
      } else if (is("solid") || is("endsolid")) {
        text += is("solid") ? "solid\n" : "endsolid\n";
        break;  // a name may follow
      } else if (!normal && !is("loop") && !(i + 1 == words.size() && lines.rest().empty())) {
        source.reject(lines.number(), quote_word(word) + " is no word of an STL file; export the mesh again");
      }
    }
  }
  return text;
}

}  // namespace

void validate_off(const MeshSource& source) {
  LineReader lines(source.bytes);
  Words words;
  if (!next_words(lines, words)) source.reject(0, "holds no mesh; export it again");
  const OffKind kind = off_kind(source, lines.number(), words[0]);
  const OffCounts counts = off_counts(source, lines, words);
  guard_off_vertices(source, lines, kind, counts.vertices);
  guard_off_faces(source, lines, kind, counts);
  if (next_words(lines, words))
    source.reject(lines.number(), "more lines than the counts announce, " + std::to_string(counts.vertices) +
                                      " vertices and " + std::to_string(counts.faces) +
                                      " faces; correct the counts");
}

std::string normalise_obj(const MeshSource& as_it_is) {
  const MeshSource source = with_joined_lines(as_it_is);
  const std::size_t count = count_obj_vertices(source);
  std::string text;
  std::size_t vertices = 0;
  std::size_t faces = 0;
  LineReader lines(source.bytes);
  for (Words words; next_words(lines, words);) {
    if (!obj_statement(words[0]))
      source.reject(lines.number(),
                    quote_word(words[0]) + " is no statement of an OBJ file; export the mesh again");
    if (words[0] == "v") {
      const std::string what = "vertex " + std::to_string(vertices++);
      if (words.size() < 4)
        source.reject(lines.number(), what + ": expected 3 numbers, found " +
                                          std::to_string(words.size() - 1) + "; export the mesh again");
      require_numbers(source, lines.number(), words, 1, 4, what);
      append_line(text, {words.begin(), words.begin() + 4});
    } else if (words[0] == "f") {
      text += 'f';
      for (std::size_t i = 1; i < words.size(); ++i) {
        const auto v = obj_corner(words[i], vertices);
        if (!v || *v < 0 || static_cast<std::size_t>(*v) >= count)
          source.reject(lines.number(), "face " + std::to_string(faces) + ": there is no vertex " +
                                            quote_word(words[i]) + "; there are " + std::to_string(count) +
                                            ", numbered from 1: export the mesh again");
        text += ' ' + std::to_string(*v + 1);
      }
      text += '\n';
      ++faces;
    }
  }
  if (faces == 0) source.reject(0, "has no faces; a tool needs a closed surface");
  return text;
}

// A binary file may begin with "solid" too, so its size decides: 84 bytes and 50 a triangle.
std::string normalise_stl(MeshSource source) {
  const std::size_t size = source.bytes.size();
  const std::size_t triangles = size < kStlHeader ? 0 : at<std::uint32_t>(source.bytes, 80);
  const std::size_t binary_size = kStlHeader + kStlTriangle * triangles;
  if (size == binary_size) {
    guard_binary_stl(source, triangles);
    return std::move(source.bytes);
  }
  const auto start = source.bytes.find_first_not_of(" \t\r\n");
  if (start != std::string::npos && is_word(std::string_view(source.bytes).substr(start, 5), "solid"))
    return guarded_ascii_stl(source);
  if (size < kStlHeader) source.reject(0, "is too short for an STL; export the mesh again");
  source.reject(0, "does not begin with 'solid', and a binary STL of " + std::to_string(triangles) +
                       " triangles has " + std::to_string(binary_size) + " bytes, not " +
                       std::to_string(size) + ": it is cut short, or no STL; export the mesh again");
}

}  // namespace wrenchd
