// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_source.hpp"

#include <algorithm>
#include <charconv>

#include "collision/meshes/mesh_file.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr std::string_view kBlanks = " \t\r\f\v";

/// from_chars knows no leading plus.
std::string_view without_plus(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  return word;
}

template <typename T>
std::optional<T> parsed(std::string_view word) noexcept {
  word = without_plus(word);
  T x{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
  if (error != std::errc{} || end != word.data() + word.size()) return {};
  return x;
}

}  // namespace

void MeshSource::reject(std::size_t line, const std::string& message) const {
  throw MeshError(file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + message);
}

bool LineReader::next(std::string_view& line) noexcept {
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find('\n');
  line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  ++number_;
  return true;
}

std::vector<std::string_view> split_words(std::string_view line) {
  line = line.substr(0, line.find('#'));
  std::vector<std::string_view> words;
  for (;;) {
    const std::size_t start = line.find_first_not_of(kBlanks);
    if (start == std::string_view::npos) return words;
    line.remove_prefix(start);
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::optional<double> parse_number(std::string_view word) noexcept {
  const auto x = parsed<double>(word);
  return x && is_finite(*x) ? x : std::nullopt;
}

std::optional<long long> parse_integer(std::string_view word) noexcept {
  return parsed<long long>(word);
}

std::string quote_word(std::string_view word) {
  constexpr std::size_t kLongest = 40;
  std::string text(word.substr(0, kLongest));
  if (word.size() > kLongest) text += "...";
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return "'" + text + "'";
}

}  // namespace wrenchd
