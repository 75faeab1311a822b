// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// The bytes of a mesh file, and its name for messages.
struct MeshSource {
  std::filesystem::path file;
  std::string bytes;

  /// Throws MeshError "FILE: message" or, from line 1 on, "FILE:LINE: message".
  [[noreturn]] void reject(std::size_t line, const std::string& message) const;
};

/// Walks the lines of a text; a carriage return at the end is no part of a line.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : rest_(text) {}

  bool next(std::string_view& line) noexcept;
  std::size_t number() const noexcept { return number_; }  ///< of the last line given, from 1
  std::string_view rest() const noexcept { return rest_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

/// The words between blanks, in front of a '#'.
std::vector<std::string_view> split_words(std::string_view line);

/// The whole word as a number: nothing where it is none, infinite or NaN. Knows no locale.
std::optional<double> parse_number(std::string_view word) noexcept;
std::optional<long long> parse_integer(std::string_view word) noexcept;

/// 'WORD', cut short and on one line, as a message may repeat it.
std::string quote_word(std::string_view word);

/// What CGAL's readers take on trust, looked at before them: counts that they reserve memory for, types that
/// they assume, numbers that they round or pass over. Each throws MeshError that names the line and the cure,
/// and returns when the reader has nothing left to trip on. Time and memory are in proportion to the file.
void validate_off(const MeshSource& source);
/// The same; what exporters write in other ways than CGAL expects is rewritten. Of OBJ the vertex and face
/// lines are left, with single blanks and vertices counted from 1; of ascii STL the corners, without names,
/// normals and capitals; of PLY the header without carriage returns.
std::string normalise_obj(const MeshSource& source);
std::string normalise_stl(MeshSource source);
std::string normalise_ply(MeshSource source);

}  // namespace wrenchd
