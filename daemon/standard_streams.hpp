// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

namespace wrenchd {

/// Opens /dev/null in place of each of the descriptors 0, 1 and 2 that is closed. Otherwise the next file
/// that the process opens, for example a recording, gets such a number and receives what is meant for a
/// terminal. Call it first in main(). Returns false if a descriptor is closed and /dev/null cannot be opened.
/// Not RT-safe: system calls.
bool open_standard_streams() noexcept;

/// Writes all bytes. Returns false if the other end is closed or a write fails. Not RT-safe: waits for the
/// reader.
bool write_all(int descriptor, std::string_view bytes) noexcept;

/// Writes the text to standard error if that is possible without waiting, in one call; otherwise drops it.
/// Async-signal-safe.
void write_error_without_waiting(std::string_view text) noexcept;

}  // namespace wrenchd
