// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/config_error.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace wrenchd {
namespace {

std::string to_lines(const std::vector<Rejection>& rejections) {
  std::string lines;
  for (const Rejection& rejection : rejections) {
    if (!lines.empty()) lines += '\n';
    lines += to_text(rejection);
  }
  return lines;
}

bool earlier(const Rejection& a, const Rejection& b) {
  const bool a_inherited = a.location.file != nullptr, b_inherited = b.location.file != nullptr;
  return std::tie(a_inherited, a.location.line, a.location.column) <
         std::tie(b_inherited, b.location.line, b.location.column);
}

}  // namespace

std::string to_text(const Rejection& rejection) {
  std::string where = rejection.file.string();
  if (rejection.location.line > 0) {
    where += ':' + std::to_string(rejection.location.line) + ':' + std::to_string(rejection.location.column);
  }
  return where + ": " + rejection.message;
}

std::string printable(std::string text, std::size_t longest) {
  if (text.size() > longest) text = text.substr(0, longest) + "...";
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

bool has_control_characters(std::string_view text) noexcept {
  return std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

ConfigError::ConfigError(std::vector<Rejection> rejections)
    : std::runtime_error(to_lines(rejections)), rejections_(std::move(rejections)) {}

ConfigError::ConfigError(std::filesystem::path file, SourceLocation place, std::string message)
    : ConfigError(std::vector<Rejection>{{std::move(file), place, std::move(message)}}) {}

std::string ConfigError::without_content() const {
  std::vector<Rejection> bare = rejections_;
  for (Rejection& rejection : bare)
    if (rejection.location.line > 0)
      rejection.message =
          "is not valid; run 'wrenchctl check' on the file, which tells those who may read it";
  return to_lines(bare);
}

void RejectionList::add(SourceLocation place, std::string message) {
  const std::filesystem::path& file = place.file ? *place.file : file_;
  rejections_.push_back({file, std::move(place), std::move(message)});
}

void RejectionList::throw_if_any() {
  if (rejections_.empty()) return;
  std::stable_sort(rejections_.begin(), rejections_.end(), earlier);
  throw ConfigError(std::move(rejections_));
}

}  // namespace wrenchd
