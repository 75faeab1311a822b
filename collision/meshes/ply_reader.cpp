// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/ply_reader.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

// A PLY file has a header that declares elements with their properties, and then the values, as text or
// binary.

namespace wrenchd {
namespace {

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct PlyTypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array<PlyTypeName, 16> kTypes = {{{"char", PlyType::int8},
                                                 {"int8", PlyType::int8},
                                                 {"uchar", PlyType::uint8},
                                                 {"uint8", PlyType::uint8},
                                                 {"short", PlyType::int16},
                                                 {"int16", PlyType::int16},
                                                 {"ushort", PlyType::uint16},
                                                 {"uint16", PlyType::uint16},
                                                 {"int", PlyType::int32},
                                                 {"int32", PlyType::int32},
                                                 {"uint", PlyType::uint32},
                                                 {"uint32", PlyType::uint32},
                                                 {"float", PlyType::float32},
                                                 {"float32", PlyType::float32},
                                                 {"double", PlyType::float64},
                                                 {"float64", PlyType::float64}}};

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::optional<PlyType> length_type;  ///< type of a list's length; empty: no list
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool is_text = true;
  bool is_swapped = false;  ///< the byte order differs from that of this machine
  std::vector<PlyElement> elements;
};

bool is_integer(PlyType type) {
  return type != PlyType::float32 && type != PlyType::float64;
}

template <typename T>
bool fits(double x) {
  return x >= static_cast<double>(std::numeric_limits<T>::lowest()) &&
         x <= static_cast<double>(std::numeric_limits<T>::max());
}

/// Calls use(T{}) with the C++ type.
template <typename Use>
auto with_type(PlyType type, Use use) {
  switch (type) {
    case PlyType::int8:
      return use(std::int8_t{});
    case PlyType::uint8:
      return use(std::uint8_t{});
    case PlyType::int16:
      return use(std::int16_t{});
    case PlyType::uint16:
      return use(std::uint16_t{});
    case PlyType::int32:
      return use(std::int32_t{});
    case PlyType::uint32:
      return use(std::uint32_t{});
    case PlyType::float32:
      return use(float{});
    case PlyType::float64:
      break;
  }
  return use(double{});
}

PlyType type_of(const MeshSource& source, std::size_t line, std::string_view word) {
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  source.reject(line, quote_word(word) + " is no type of PLY; export the mesh again");
}

void read_format(const MeshSource& source, std::size_t line, const std::vector<std::string_view>& words,
                 PlyHeader& header) {
  const std::string_view format = words.size() == 3 && words[0] == "format" ? words[1] : std::string_view();
  const bool little = format == "binary_little_endian";
  if (format != "ascii" && !little && format != "binary_big_endian")
    source.reject(
        line,
        "expected 'format ascii 1.0', 'binary_little_endian' or 'binary_big_endian'; export the mesh again");
  header.is_text = format == "ascii";
  header.is_swapped = little != (std::endian::native == std::endian::little);
}

void read_element(const MeshSource& source, std::size_t line, const std::vector<std::string_view>& words,
                  PlyHeader& header) {
  const auto count = words.size() == 3 ? parse_integer(words[2]) : std::nullopt;
  if (!count || *count < 0) source.reject(line, "expected 'element NAME COUNT'; export the mesh again");
  header.elements.push_back({std::string(words[1]), static_cast<std::size_t>(*count), {}});
}

void read_property(const MeshSource& source, std::size_t line, const std::vector<std::string_view>& words,
                   PlyHeader& header) {
  const bool list = words.size() == 5 && words[1] == "list";
  if ((!list && words.size() != 3) || header.elements.empty())
    source.reject(
        line,
        "expected 'property TYPE NAME' or 'property list TYPE TYPE NAME' below an element; export the "
        "mesh again");
  PlyProperty property{std::string(words.back()), type_of(source, line, words[words.size() - 2]), {}};
  if (list) property.length_type = type_of(source, line, words[2]);
  if (list && !is_integer(*property.length_type))
    source.reject(line,
                  "the length of a list cannot be a " + std::string(words[2]) + "; export the mesh again");
  header.elements.back().properties.push_back(property);
}

PlyHeader read_header(const MeshSource& source, LineReader& lines) {
  PlyHeader header;
  std::string_view line;
  if (!lines.next(line) || split_words(line) != std::vector<std::string_view>{"ply"})
    source.reject(
        1, "expected 'ply', found " + quote_word(line) + "; save the mesh as PLY, or correct the extension");
  lines.next(line);
  read_format(source, lines.number(), split_words(line), header);
  while (lines.next(line)) {
    const auto words = split_words(line);
    const std::string_view keyword = words.empty() ? std::string_view() : words[0];
    if (keyword == "end_header") return header;
    if (keyword == "element")
      read_element(source, lines.number(), words, header);
    else if (keyword == "property")
      read_property(source, lines.number(), words, header);
    else if (keyword != "comment" && keyword != "obj_info")
      source.reject(lines.number(), quote_word(line) + " is no line of a PLY header; export the mesh again");
  }
  source.reject(lines.number(), "the header has no 'end_header'; export the mesh again");
}

const PlyProperty* find(const PlyElement& element, std::string_view name) {
  const auto same = [&](const PlyProperty& property) { return property.name == name; };
  const auto found = std::find_if(element.properties.begin(), element.properties.end(), same);
  return found == element.properties.end() ? nullptr : &*found;
}

/// Rejects colours whose components differ in type, because no exporter means them.
void require_equal_colour_types(const MeshSource& source, const PlyElement& element) {
  const PlyProperty* first = nullptr;
  for (const char* name : {"red", "green", "blue", "r", "g", "b"}) {
    const PlyProperty* colour = find(element, name);
    if (colour == nullptr) continue;
    if (first == nullptr) first = colour;
    if (colour->type != first->type || colour->length_type || first->length_type)
      source.reject(
          0, "the colours of element '" + element.name + "' differ in type; save the mesh without colours");
  }
}

void require_vertices(const MeshSource& source, const PlyElement& element) {
  for (const char* name : {"x", "y", "z"}) {
    const PlyProperty* property = find(element, name);
    if (property == nullptr || property->length_type || is_integer(property->type))
      source.reject(0, std::string("element 'vertex' needs a property '") + name +
                           "' of type float or double; save the mesh with such coordinates");
  }
}

/// Returns the list of a face's corners; null if there is none of a supported type.
const PlyProperty* corner_list(const PlyElement& element) {
  for (const char* name : {"vertex_indices", "vertex_index"}) {
    const PlyProperty* property = find(element, name);
    if (property != nullptr && property->length_type &&
        (property->type == PlyType::int32 || property->type == PlyType::uint32))
      return property;
  }
  return nullptr;
}

void require_faces(const MeshSource& source, const PlyElement& element) {
  if (corner_list(element) == nullptr)
    source.reject(0, "element '" + element.name +
                         "' needs a property list 'vertex_indices' of type int or uint; save the mesh so");
}

bool is_vertex(const PlyElement& element) {
  return element.name == "vertex" || element.name == "vertices";
}

bool is_face(const PlyElement& element) {
  return element.name == "face" || element.name == "faces";
}

/// Triangle strips, as range scanners and vcglib write them.
bool is_strip(const PlyElement& element) {
  return element.name == "tristrips" || element.name == "tristrip";
}

void check_ply_elements(const MeshSource& source, const PlyHeader& header) {
  for (const PlyElement& element : header.elements) {
    if (element.properties.empty())
      source.reject(0, "element " + quote_word(element.name) + " has no properties; export the mesh again");
    require_equal_colour_types(source, element);
    if (is_vertex(element)) require_vertices(source, element);
    if (is_face(element) || is_strip(element)) require_faces(source, element);
    if (element.name == "halfedge")
      source.reject(0, "contains half-edges; save the mesh with vertices and faces only");
  }
}

/// Reads the values behind the header.
class ValueReader {
 public:
  ValueReader(std::string_view rest, const PlyHeader& header)
      : rest_(rest), is_text_(header.is_text), is_swapped_(header.is_swapped) {}

  /// Reads a property: one value, or the values of a list. Returns false if the file ends, or if a value is
  /// no number of the declared type.
  bool read(const PlyProperty& property, std::vector<double>& values) {
    values.clear();
    std::size_t length = 1;
    if (property.length_type) {
      const auto declared = next(*property.length_type);
      if (!declared || *declared < 0.0 || *declared > static_cast<double>(rest_.size())) return false;
      length = static_cast<std::size_t>(*declared);
    }
    for (std::size_t i = 0; i < length; ++i) {
      const auto value = next(property.type);
      if (!value) return false;
      values.push_back(*value);
    }
    return true;
  }

  bool at_end() const { return rest_.find_first_not_of(" \t\r\n") == std::string_view::npos; }

 private:
  std::optional<double> next(PlyType type) { return is_text_ ? next_word(type) : next_bytes(type); }

  std::optional<double> next_word(PlyType type) {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t\r\n"));
    rest_.remove_prefix(word.size());
    if (type == PlyType::float32) return parse_single(word);
    if (is_integer(type) && !parse_integer(word)) return {};
    std::optional<double> x = parse_number(word);
    if (x && !with_type(type, [&](auto t) { return fits<decltype(t)>(*x); })) x.reset();
    return x;
  }

  std::optional<double> next_bytes(PlyType type) {
    return with_type(type, [&](auto t) -> std::optional<double> {
      if (rest_.size() < sizeof t) return {};
      std::array<char, sizeof t> bytes;
      std::memcpy(bytes.data(), rest_.data(), sizeof t);
      if (is_swapped_) std::reverse(bytes.begin(), bytes.end());
      std::memcpy(&t, bytes.data(), sizeof t);
      rest_.remove_prefix(sizeof t);
      return static_cast<double>(t);
    });
  }

  std::string_view rest_;
  bool is_text_;
  bool is_swapped_;
};

/// The properties that a mesh needs, by their position in the element; empty for other elements.
struct UsedProperties {
  std::optional<std::size_t> x, y, z;
  std::optional<std::size_t> corners;
};

std::optional<std::size_t> position_of(const PlyElement& element, const PlyProperty* property) {
  if (property == nullptr) return {};
  return static_cast<std::size_t>(property - element.properties.data());
}

UsedProperties used_properties(const PlyElement& element) {
  UsedProperties used;
  if (is_vertex(element)) {
    used.x = position_of(element, find(element, "x"));
    used.y = position_of(element, find(element, "y"));
    used.z = position_of(element, find(element, "z"));
  }
  if (is_face(element) || is_strip(element)) used.corners = position_of(element, corner_list(element));
  return used;
}

/// Adds the triangles of strips. Each vertex forms a triangle with the two vertices before it; every second
/// triangle traverses them in the opposite order. The number -1 begins a new strip. A triangle that uses a
/// vertex twice only joins two strips and is left out.
void add_strips(const std::vector<double>& values, PolygonSoup& soup) {
  std::size_t length = 0;  // vertices of the present strip so far
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] == -1.0) {
      length = 0;
      continue;
    }
    if (++length < 3) continue;
    const auto corner = [&](std::size_t k) {
      return static_cast<std::size_t>(static_cast<std::int64_t>(values[i - 2 + k]));
    };
    const std::size_t a = corner(length % 2 == 1 ? 0 : 1), b = corner(length % 2 == 1 ? 1 : 0), c = corner(2);
    if (a != b && b != c && c != a) soup.faces.push_back({a, b, c});
  }
}

/// Reads one item of an element into the soup.
void read_item(const MeshSource& source, const PlyElement& element, const UsedProperties& used,
               std::size_t number, ValueReader& reader, std::vector<double>& values, PolygonSoup& soup) {
  Vector3d p = Vector3d::Zero();
  for (std::size_t k = 0; k < element.properties.size(); ++k) {
    if (!reader.read(element.properties[k], values))
      source.reject(0, element.name + " " + std::to_string(number) + " of " + std::to_string(element.count) +
                           " is truncated, or its '" + element.properties[k].name +
                           "' is no number of the declared type; export the mesh again");
    if (k == used.x) p.x() = values[0];
    if (k == used.y) p.y() = values[0];
    if (k == used.z) p.z() = values[0];
    if (k != used.corners) continue;
    if (is_strip(element)) {
      add_strips(values, soup);
      continue;
    }
    std::vector<std::size_t>& face = soup.faces.emplace_back();
    face.reserve(values.size());
    // A negative index wraps around, as in every other format; the mesh check reports it.
    for (const double v : values) face.push_back(static_cast<std::size_t>(static_cast<std::int64_t>(v)));
  }
  if (used.x) soup.vertices.push_back(p);
}

}  // namespace

PolygonSoup read_ply(const MeshSource& source) {
  LineReader lines(source.bytes);
  const PlyHeader header = read_header(source, lines);
  check_ply_elements(source, header);
  ValueReader reader(lines.rest(), header);
  PolygonSoup soup;
  std::vector<double> values;
  for (const PlyElement& element : header.elements) {
    const UsedProperties used = used_properties(element);
    for (std::size_t i = 0; i < element.count; ++i) read_item(source, element, used, i, reader, values, soup);
  }
  if (!reader.at_end())
    source.reject(0, "continues behind the elements that its header declares; correct the counts");
  return soup;
}

}  // namespace wrenchd
