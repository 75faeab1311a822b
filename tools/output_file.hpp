// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// Writes text to a file, whole or not at all; to standard output where the name is "-". Throws
/// std::runtime_error that says what to do where it cannot be written.
void write_output(const std::string& name, const std::string& text);

}  // namespace wrenchd
