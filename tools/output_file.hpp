// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <iosfwd>
#include <string>

namespace wrenchd {

/// Writes text to a file, or to standard output if the name is "-". If writing fails, the file is unchanged.
/// Throws std::runtime_error that says what to do. Not RT-safe: writes a file.
void write_output(const std::string& name, const std::string& text);
/// Writes a file through a stream, for output that is too large for memory. If writing fails, the file is
/// unchanged. Throws std::runtime_error that says what to do. Not RT-safe: writes a file.
void write_output(const std::string& name, const std::function<void(std::ostream&)>& write);

}  // namespace wrenchd
