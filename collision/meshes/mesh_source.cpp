// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_source.hpp"

#include <algorithm>
#include <charconv>
#include <limits>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr std::string_view kBlanks = " \t\r\f\v";

/// std::from_chars accepts no leading plus sign.
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
  const std::string place = file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": ";
  throw MeshError(place + message,
                  place +
                      "is not a mesh that can be used; 'wrenchctl mesh' states the reason to a "
                      "user who may read the file");
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

bool LineReader::next_words(std::vector<std::string_view>& words) {
  for (std::string_view line; next(line);) {
    split_words(line, words);
    if (!words.empty()) return true;
  }
  words.clear();
  return false;
}

void split_words(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  line = line.substr(0, line.find('#'));
  for (;;) {
    const std::size_t start = line.find_first_not_of(kBlanks);
    if (start == std::string_view::npos) return;
    line.remove_prefix(start);
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  split_words(line, words);
  return words;
}

std::optional<double> parse_number(std::string_view word) noexcept {
  const auto x = parsed<double>(word);
  return x && is_finite(*x) ? x : std::nullopt;
}

std::optional<long long> parse_integer(std::string_view word) noexcept {
  return parsed<long long>(word);
}

std::optional<float> parse_single(std::string_view word) noexcept {
  const auto x = parse_number(word);
  constexpr double kMax = std::numeric_limits<float>::max();
  if (!x || *x < -kMax || *x > kMax) return {};
  // std::from_chars reports an underflow as an error.
  return parsed<float>(word).value_or(static_cast<float>(*x));
}

double require_number(const MeshSource& source, std::size_t line, std::string_view word,
                      const std::string& what) {
  const auto x = parse_number(word);
  if (!x)
    source.reject(line,
                  what + ": expected a finite number, found " + quote_word(word) + "; export the mesh again");
  return *x;
}

std::array<double, 3> require_point(const MeshSource& source, std::size_t line,
                                    const std::vector<std::string_view>& words, std::size_t first,
                                    const std::string& what) {
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) p[i] = require_number(source, line, words[first + i], what);
  return p;
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
