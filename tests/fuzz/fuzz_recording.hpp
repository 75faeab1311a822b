// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// First byte of an input of fuzz_recording: the remaining bytes are a file, or what the child process sends.
enum class RecordingInput : std::uint8_t { stream, file };

}  // namespace wrenchd::test
