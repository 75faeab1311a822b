// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// Returns a text of libudev; empty for null, which libudev returns for what it does not know. Not RT-safe:
/// allocates.
inline std::string udev_text(const char* s) {
  return s == nullptr ? std::string() : std::string(s);
}

}  // namespace wrenchd
