// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/recording/recording_file.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

/// The first number that differs between a replay and its recording.
struct Difference {
  std::size_t hand = 0;  ///< 1: the second hand of a run with two hands
  std::uint64_t tick = 0;
  std::string field;
  double recorded = 0.0;
  double replayed = 0.0;
};

/// Feeds the recorded samples through a servo loop with the same configuration, offline, and compares the
/// recorded outputs with the new outputs bit for bit. Returns nothing if all ticks agree. Does not compare
/// times. Scene time is that of the recorded ticks, so obstacles move as recorded. Throws RecordingError if
/// the recording does not begin at the first tick of the loop, or if ticks are missing. Not RT-safe: takes as
/// long as the ticks need.
std::optional<Difference> replay(const Recording& recording, const RunConfig& config);
/// The same for the recordings of both hands of a run: their ticks alternate as they did.
std::optional<Difference> replay_two_hands(const std::array<Recording, 2>& recordings,
                                           const std::array<RunConfig, 2>& configs);

/// Returns the names of the compared columns.
const char* compared_fields();

}  // namespace wrenchd
