// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

namespace wrenchd {

/// Returns true if a profile may have this name: 1 to 64 letters, digits, '_', '.' and '-'. udev rules, logs
/// and records contain the name as it is. RT-safe.
constexpr bool is_profile_name(std::string_view name) noexcept {
  constexpr std::size_t kLongest = 64;
  constexpr std::string_view kAllowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-";
  return !name.empty() && name.size() <= kLongest &&
         name.find_first_not_of(kAllowed) == std::string_view::npos;
}

}  // namespace wrenchd
