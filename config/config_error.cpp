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

ConfigError::ConfigError(std::vector<Rejection> rejections)
    : std::runtime_error(to_lines(rejections)), rejections_(std::move(rejections)) {}

ConfigError::ConfigError(std::filesystem::path file, SourceLocation place, std::string message)
    : ConfigError(std::vector<Rejection>{{std::move(file), place, std::move(message)}}) {}

std::string ConfigError::public_text(const std::filesystem::path& readable) const {
  std::vector<Rejection> shown = rejections_;
  for (Rejection& rejection : shown) {
    // A message about the whole file, such as "no such file", quotes none of it.
    if (rejection.file != readable && rejection.location.line > 0)
      rejection.message = "is not valid; 'wrenchctl check' states the reason to a user who may read the file";
  }
  return to_lines(shown);
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
