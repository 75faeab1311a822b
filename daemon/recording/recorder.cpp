// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recorder.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Largest number of chunks in a piece. Between two pieces the writer checks the disk and serves other files.
constexpr std::size_t kMostChunks = 8;

}  // namespace

Recorder::Recorder(const RecordHistory& history, const std::filesystem::path& file,
                   const RecordingHeader& header, std::uint64_t first)
    : history_(history), file_(file), writer_(file, header), next_(first) {}

bool Recorder::write_next(std::uint64_t end, bool rest) {
  const std::uint64_t begin = std::max(next_, history_.stored_range().begin);
  const std::uint64_t there = end - std::min(begin, end);
  std::size_t most = std::min<std::uint64_t>(there, kMostChunks * RecordingWriter::kChunkTicks);
  // An incomplete chunk is compressed again when it grows, so only the last chunk may be incomplete.
  if (!rest || most < there) most -= (written_ + most) % RecordingWriter::kChunkTicks;
  if (most == 0 || most > there) return false;
  const std::uint64_t first = history_.copy(next_, end, most, batch_);
  lost_ += first - next_;
  writer_.append(batch_);
  writer_.flush();
  written_ += batch_.ticks.size();
  next_ = first + batch_.ticks.size();
  return !batch_.ticks.empty();
}

void Recorder::write_events(std::span<RecordedEvent> events) {
  if (events.empty()) return;
  for (RecordedEvent& event : events) event.tick = history_.tick_at(event.time_ns);
  writer_.append_events(events);
  writer_.flush();
}

}  // namespace wrenchd
