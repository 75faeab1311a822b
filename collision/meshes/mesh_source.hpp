// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace wrenchd {

/// Reports a mesh that cannot be used: the file, the defect, its place and the remedy. The message has one
/// line for each defect.
class MeshError : public std::runtime_error {
 public:
  explicit MeshError(const std::string& message) : MeshError(message, message) {}
  /// public_text: the message without any content of the file.
  MeshError(const std::string& message, std::string public_text)
      : std::runtime_error(message), public_text_(std::move(public_text)) {}
  /// The message for someone who may not read the file.
  const std::string& public_text() const noexcept { return public_text_; }

 private:
  std::string public_text_;
};

/// The bytes of a mesh file, and its name for messages.
struct MeshSource {
  std::filesystem::path file;
  std::string bytes;

  /// Throws MeshError "FILE: message", or "FILE:LINE: message" if line > 0. The message may quote the file,
  /// so the public text of the error is another one. Not RT-safe: throws.
  [[noreturn]] void reject(std::size_t line, const std::string& message) const;
};

/// Iterates over the lines of a text. Removes a carriage return at the end of a line.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : rest_(text) {}

  /// Returns false at the end of the text. RT-safe.
  bool next(std::string_view& line) noexcept;
  /// Splits the next line that contains a word. Returns false, and no words, at the end of the text. Not
  /// RT-safe: allocates.
  bool next_words(std::vector<std::string_view>& words);
  std::size_t number() const noexcept { return number_; }  ///< number of the last line, from 1
  std::string_view rest() const noexcept { return rest_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

/// Splits a line into words up to a '#'. Blanks separate words. Not RT-safe: allocates.
void split_words(std::string_view line, std::vector<std::string_view>& words);
std::vector<std::string_view> split_words(std::string_view line);

/// Returns the value of the whole word, or nothing if it is not a finite number. Independent of the locale.
/// RT-safe.
std::optional<double> parse_number(std::string_view word) noexcept;
std::optional<long long> parse_integer(std::string_view word) noexcept;
/// Returns the value of the whole word rounded once to single precision, or nothing if it is not a finite
/// number in the range of float. RT-safe.
std::optional<float> parse_single(std::string_view word) noexcept;

/// Returns the value of a word. Rejects the file if it is not a finite number. what: the element, for
/// example "vertex 3". Not RT-safe: throws MeshError.
double require_number(const MeshSource& source, std::size_t line, std::string_view word,
                      const std::string& what);
/// Returns three consecutive values, from words[first] on. Precondition: the words exist. Not RT-safe: throws
/// MeshError.
std::array<double, 3> require_point(const MeshSource& source, std::size_t line,
                                    const std::vector<std::string_view>& words, std::size_t first,
                                    const std::string& what);

/// Returns 'WORD' for messages: truncated, on one line. Not RT-safe: allocates.
std::string quote_word(std::string_view word);

}  // namespace wrenchd
