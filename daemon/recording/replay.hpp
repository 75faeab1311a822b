// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/recording/recording_file.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

/// The first place where a replay and its recording part.
struct Difference {
  std::uint64_t tick = 0;
  std::string field;
  double recorded = 0.0;
  double replayed = 0.0;
};

/// Feeds the recorded samples through a servo loop of the same config, offline and at once, and compares what
/// came out then with what comes out now, bit for bit. Nothing: all ticks agree. Times are not compared.
/// Scene time is that of the ticks, so obstacles move as they did. Throws RecordingError where the recording
/// does not begin at the loop's first tick, or where ticks are missing in it.
std::optional<Difference> replay(const Recording& recording, const RunConfig& config);

/// The columns that are compared, for people.
const char* compared_fields();

}  // namespace wrenchd
