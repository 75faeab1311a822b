// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/config_error.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace wrenchd {
namespace {

std::string to_lines(const std::vector<Refusal>& refusals) {
  std::string lines;
  for (const Refusal& refusal : refusals) {
    if (!lines.empty()) lines += '\n';
    lines += to_text(refusal);
  }
  return lines;
}

bool earlier(const Refusal& a, const Refusal& b) {
  const bool a_inherited = a.location.file != nullptr, b_inherited = b.location.file != nullptr;
  return std::tie(a_inherited, a.location.line, a.location.column) <
         std::tie(b_inherited, b.location.line, b.location.column);
}

}  // namespace

std::string to_text(const Refusal& refusal) {
  std::string where = refusal.file.string();
  if (refusal.location.line > 0) {
    where += ':' + std::to_string(refusal.location.line) + ':' + std::to_string(refusal.location.column);
  }
  return where + ": " + refusal.message;
}

std::string printable(std::string text, std::size_t longest) {
  if (text.size() > longest) text = text.substr(0, longest) + "...";
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

ConfigError::ConfigError(std::vector<Refusal> refusals)
    : std::runtime_error(to_lines(refusals)), refusals_(std::move(refusals)) {}

ConfigError::ConfigError(std::filesystem::path file, SourceLocation place, std::string message)
    : ConfigError(std::vector<Refusal>{{std::move(file), place, std::move(message)}}) {}

void RefusalList::add(SourceLocation place, std::string message) {
  const std::filesystem::path& file = place.file ? *place.file : file_;
  refusals_.push_back({file, std::move(place), std::move(message)});
}

void RefusalList::throw_if_any() {
  if (refusals_.empty()) return;
  std::stable_sort(refusals_.begin(), refusals_.end(), earlier);
  throw ConfigError(std::move(refusals_));
}

}  // namespace wrenchd
