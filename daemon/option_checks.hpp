// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdlib>
#include <string>

#include <CLI/CLI.hpp>

namespace wrenchd {

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
