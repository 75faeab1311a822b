// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: daemon/recording/recording_stream.cpp
#include <algorithm>
#include <string>

#include "daemon/recording/recording_stream.hpp"
#include "tests/fuzz/feed.hpp"

// Decodes any bytes as the stream of a child process that has read a hostile recording. Libhdf5 itself is not
// under test: it runs in the child, where a crash does no harm. The decoder throws RecordingError, or the
// recording is consistent.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

void check(const Recording& recording) {
  require(recording.contact_ranges.size() == recording.ticks.size(), "each tick has a range of contacts");
  for (std::size_t row = 0; row < recording.ticks.size(); ++row) {
    const ContactRange& range = recording.contact_ranges[row];
    require(range.first + range.count <= recording.contacts.size(), "contacts are in range");
  }
  for (const RecordedFile& file : recording.header.files)
    require(file.role.find('/') == std::string::npos && !file.role.empty(), "roles are file names");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Feed feed({data, size});
  const std::size_t step = 1 + feed.byte();
  const auto rest = feed.rest();
  const std::string_view stream(reinterpret_cast<const char*>(rest.data()), rest.size());
  try {
    RecordingDecoder decoder("input.h5", 1 << 20);
    for (std::size_t at = 0; at < stream.size() && decoder.feed(stream.substr(at, step)); at += step) {
    }
    check(decoder.take());
  } catch (const RecordingError& error) {
    require(std::string(error.what()).starts_with("input.h5: "), "a RecordingError names the file");
  }
  return 0;
}
