// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mat_file.hpp"

#include <algorithm>
#include <stdexcept>

namespace wrenchd {
namespace {

// Types of data, and classes of matrices, of the format.
enum DataType : std::uint32_t {
  kInt8 = 1,
  kUint8 = 2,
  kUint16 = 4,
  kInt32 = 5,
  kUint32 = 6,
  kDouble = 9,
  kInt64 = 12,
  kUint64 = 13,
  kMatrix = 14,
  kUtf16 = 17,
};
enum Class : std::uint32_t {
  kCell = 1,
  kStruct = 2,
  kChar = 4,
  kDoubles = 6,
  kUint8s = 9,
  kUint16s = 11,
  kUint32s = 13,
  kInt64s = 14,
  kUint64s = 15
};

constexpr std::size_t kHeaderText = 116;
/// Largest element; MATLAB rejects larger ones.
constexpr std::uint64_t kMaxBytes = (std::uint64_t{1} << 31) - 1;
/// Length of the names of members: 31 letters and a zero byte.
constexpr std::uint32_t kMemberName = 32;

void put_u32(std::string& to, std::uint32_t number) {
  for (int i = 0; i < 4; ++i) to += static_cast<char>((number >> (8 * i)) & 0xFFU);
}

/// An element: tag, data, and zeros up to a multiple of 8 bytes.
std::string element(std::uint32_t type, const std::string& data) {
  if (data.size() > kMaxBytes)
    throw std::runtime_error(
        "a variable of a MAT-file has at most 2 GB; export fewer ticks with --every, --from and --to, or "
        "fewer "
        "columns with --columns");
  std::string bytes;
  put_u32(bytes, type);
  put_u32(bytes, static_cast<std::uint32_t>(data.size()));
  bytes += data;
  if (type != kMatrix) bytes.append((8 - data.size() % 8) % 8, '\0');
  return bytes;
}

std::string matrix(const std::string& name, std::uint32_t kind, std::size_t rows, std::size_t columns,
                   const std::string& data) {
  std::string flags, dimensions;
  put_u32(flags, kind);
  put_u32(flags, 0);
  put_u32(dimensions, static_cast<std::uint32_t>(rows));
  put_u32(dimensions, static_cast<std::uint32_t>(columns));
  return element(kMatrix,
                 element(kUint32, flags) + element(kInt32, dimensions) + element(kInt8, name) + data);
}

std::pair<std::uint32_t, std::uint32_t> types_of(FieldType type) {
  switch (type) {
    case FieldType::u8:
      return {kUint8s, kUint8};
    case FieldType::u16:
      return {kUint16s, kUint16};
    case FieldType::u32:
      return {kUint32s, kUint32};
    case FieldType::u64:
      return {kUint64s, kUint64};
    case FieldType::i64:
      return {kInt64s, kInt64};
    case FieldType::f64:
      break;
  }
  return {kDoubles, kDouble};
}

/// Returns the code points of an UTF-8 text as UTF-16. An invalid byte becomes a question mark.
std::u16string utf16(const std::string& text) {
  std::u16string to;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const int more = first < 0x80 ? 0 : first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : first >= 0xC0 ? 1 : -1;
    if (more < 0 || i + static_cast<std::size_t>(more) >= text.size() + (more == 0 ? 1 : 0)) {
      to += u'?';
      ++i;
      continue;
    }
    std::uint32_t code = more == 0 ? first : first & (0x3FU >> more);
    for (int k = 1; k <= more; ++k)
      code = code << 6U | (static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]) & 0x3FU);
    i += static_cast<std::size_t>(more) + 1;
    if (code >= 0x10000) {
      to += static_cast<char16_t>(0xD800 + ((code - 0x10000) >> 10U));
      to += static_cast<char16_t>(0xDC00 + (code & 0x3FFU));
    } else {
      to += static_cast<char16_t>(code);
    }
  }
  return to;
}

}  // namespace

std::string mat_header() {
  std::string bytes = "MATLAB 5.0 MAT-file, written by wrenchctl export";
  bytes.resize(kHeaderText, ' ');
  bytes.append(8, '\0');  // no data of subsystems
  bytes += '\0';
  bytes += '\1';        // version 0x0100
  return bytes + "IM";  // little-endian
}

std::string mat_matrix(const std::string& name, FieldType type, std::size_t rows, std::size_t columns,
                       const std::string& bytes) {
  const auto [kind, data] = types_of(type);
  return matrix(name, kind, rows, columns, element(data, bytes));
}

std::string mat_text(const std::string& name, const std::string& text) {
  std::string bytes;
  const std::u16string units = utf16(text);
  for (const char16_t unit : units) {
    bytes += static_cast<char>(unit & 0xFFU);
    bytes += static_cast<char>(unit >> 8U);
  }
  return matrix(name, kChar, units.empty() ? 0 : 1, units.size(), element(kUtf16, bytes));
}

std::string mat_texts(const std::string& name, std::span<const std::string> texts) {
  std::string cells;
  for (const std::string& text : texts) cells += mat_text("", text);
  return matrix(name, kCell, texts.size(), 1, cells);
}

std::string mat_struct(const std::string& name,
                       std::span<const std::pair<std::string, std::string>> members) {
  std::string names, values, length;
  for (const auto& [member, value] : members) {
    names += member.substr(0, kMemberName - 1);
    names.append(kMemberName - std::min<std::size_t>(member.size(), kMemberName - 1), '\0');
    values += value;
  }
  put_u32(length, kMemberName);
  // The tag of the length is a small element: type and size share four bytes.
  std::string tag;
  put_u32(tag, std::uint32_t{4} << 16U | kInt32);
  return matrix(name, kStruct, 1, 1, tag + length + element(kInt8, names) + values);
}

}  // namespace wrenchd
