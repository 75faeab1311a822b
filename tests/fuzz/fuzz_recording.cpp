// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: daemon/recording/recording_stream.cpp daemon/recording/recording_reader.cpp
// daemon/recording/recording_file.cpp
#include "tests/fuzz/fuzz_recording.hpp"

#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/files/opened_file.hpp"
#include "daemon/recording/recording_reader.hpp"
#include "daemon/recording/recording_stream.hpp"
#include "tests/fuzz/feed.hpp"

// Reads any bytes as a recording file, in the child process that calls libhdf5, or as what such a child sends
// after a hostile file has taken it over. The reader throws RecordingError or BrokenStream, or the recording
// is whole.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Closes its file descriptor.
struct Descriptor {
  int fd;
  ~Descriptor() { ::close(fd); }
};

std::string bytes_of(Feed& feed) {
  return {feed.rest().begin(), feed.rest().end()};
}

void read_stream(const std::string& bytes) {
  int ends[2];
  require(::pipe2(ends, O_CLOEXEC) == 0, "a pipe");
  const Descriptor read_end{ends[0]};
  {
    const Descriptor write_end{ends[1]};
    require(::fcntl(ends[1], F_SETPIPE_SZ, 1 << 20) > 0, "a pipe with room for the input");
    require(::write(ends[1], bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
            "room in the pipe");
  }
  receive_recording(read_end.fd, "input.h5", std::uint64_t{1} << 26, [] {});
}

void read_file_of(const std::string& bytes) {
  const Descriptor memory{::memfd_create("input", MFD_CLOEXEC)};
  require(::write(memory.fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
          "a file in memory");
  const OpenedFile opened("/proc/self/fd/" + std::to_string(memory.fd));
  const Recording recording = read_recording(opened, "input.h5");
  require(recording.ticks.size() == recording.contact_ranges.size(), "each tick has its contacts");
  for (std::size_t row = 0; row < recording.ticks.size(); ++row)
    require(recording.contacts_of(row).size() <= recording.contacts.size(), "contacts are in range");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Feed feed({data, size});
  const auto kind = static_cast<RecordingInput>(feed.byte() % 2);
  try {
    if (kind == RecordingInput::stream)
      read_stream(bytes_of(feed));
    else
      read_file_of(bytes_of(feed));
  } catch (const RecordingError& error) {
    require(std::string(error.what()).starts_with("input.h5: "), "a RecordingError names the file");
  } catch (const BrokenStream&) {
    require(kind == RecordingInput::stream, "the reader of a file says what is wrong");
  }
  return 0;
}
