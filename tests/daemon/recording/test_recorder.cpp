// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/recording/recorder.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_recorder {

using namespace wrenchd::test;

namespace {

void append(RecordHistory& history, std::uint64_t from, std::uint64_t to) {
  for (std::uint64_t i = from; i < to; ++i) {
    StateRecord record{};
    record.tick.tick = i;
    record.tick.now_ns = static_cast<std::int64_t>(i) * 1'000'000;
    history.append(record);
  }
}

}  // namespace

TEST_CASE("ticks that the history overwrote before they were written are counted as lost", "[recording]") {
  const TemporaryDirectory files;
  RecordHistory history(100);
  {
    Recorder recorder(history, files.path() / "run.h5", {}, 0);
    append(history, 0, 250);
    CHECK(recorder.write_next(history.stored_range().end, true));
    CHECK(recorder.written() == 100);
    CHECK(recorder.lost() == 150);
    CHECK(recorder.next() == 250);
    CHECK_FALSE(recorder.write_next(history.stored_range().end, true));
    append(history, 250, 260);
    CHECK(recorder.write_next(history.stored_range().end, true));
    CHECK(recorder.lost() == 150);
  }
  const Recording recording = read_recording(files.path() / "run.h5");
  REQUIRE(recording.ticks.size() == 110);
  for (std::size_t i = 0; i < 110; ++i) REQUIRE(recording.ticks[i].tick == 150 + i);
}

TEST_CASE("until the end only whole chunks are written; the end writes the rest", "[recording]") {
  constexpr std::uint64_t kChunk = RecordingWriter::kChunkTicks;
  const TemporaryDirectory files;
  RecordHistory history(20 * kChunk);
  Recorder recorder(history, files.path() / "run.h5", {}, 0);
  append(history, 0, kChunk - 1);
  CHECK_FALSE(recorder.write_next(history.stored_range().end, false));
  append(history, kChunk - 1, 2 * kChunk + 7);
  CHECK(recorder.write_next(history.stored_range().end, false));
  CHECK(recorder.written() == 2 * kChunk);
  CHECK_FALSE(recorder.write_next(history.stored_range().end, false));
  CHECK(recorder.write_next(history.stored_range().end, true));
  CHECK(recorder.written() == 2 * kChunk + 7);
  append(history, 2 * kChunk + 7, 4 * kChunk);
  CHECK(recorder.write_next(history.stored_range().end, false));
  CHECK(recorder.written() == 4 * kChunk);
}

}  // namespace wrenchd::test_recorder
