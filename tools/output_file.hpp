// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <iosfwd>
#include <string>

namespace wrenchd {

/// Writes text to a file, whole or not at all; to standard output where the name is "-". Throws
/// std::runtime_error that says what to do where it cannot be written.
void write_output(const std::string& name, const std::string& text);
/// The same for what is too long to be held in memory.
void write_output(const std::string& name, const std::function<void(std::ostream&)>& write);

}  // namespace wrenchd
