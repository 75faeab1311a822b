// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/nearest_key.hpp"

namespace wrenchd {

/// Accepts one of these words. The help lists them, and the shell completion reads them there. Not RT-safe:
/// allocates.
inline CLI::Validator one_of(const std::vector<std::string>& words) {
  const std::string list = CLI::detail::generate_set(words);
  return {[=](std::string& text) -> std::string {
            if (std::find(words.begin(), words.end(), text) != words.end()) return {};
            return text + " not in " + list + nearest_name_advice(text, words);
          },
          list};
}

/// Accepts a number from min to max. The range check of CLI11 accepts NaN too. Not RT-safe: allocates.
inline CLI::Validator number_in_range(double min, double max) {
  const std::string range = CLI::detail::to_string(min) + " to " + CLI::detail::to_string(max);
  return {[=](std::string& text) -> std::string {
            char* end = nullptr;
            const double x = std::strtod(text.c_str(), &end);
            if (end != text.c_str() && *end == '\0' && x >= min && x <= max) return {};
            return "expected a number from " + range + ", found '" + text + "'";
          },
          range};
}

/// Rejects an empty text, which an unset variable in a shell script produces. Not RT-safe: allocates.
inline CLI::Validator not_empty(const std::string& cure = "name a file") {
  return {[=](std::string& text) -> std::string { return text.empty() ? "must not be empty; " + cure : ""; },
          ""};
}

}  // namespace wrenchd
