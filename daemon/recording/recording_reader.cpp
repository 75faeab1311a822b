// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_reader.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <limits>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/files/limited_process.hpp"
#include "daemon/control/owned_fd.hpp"

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// Processor time for reading: a fixed part, and a part for each 4 MiB of the file. libhdf5 reads more than
/// 50 MiB of a compressed recording in a second.
constexpr double kReading_s = 1.0;
constexpr double kBytesPerSecond = 4.0 * 1024 * 1024;
/// A machine under load, or a slow disk, may take this many times longer than the processor.
constexpr double kWallFactor = 20.0;
/// Address space for libhdf5, beside what the process had. It reads and sends rows in pieces.
constexpr std::uint64_t kAddressSpace = std::uint64_t{1} << 30;
/// What a recording may unpack to: a fixed part, and a multiple of the size of its file. Recordings of a hand
/// at rest shrink to a hundredth.
constexpr std::uint64_t kUnpackedBytes = std::uint64_t{1} << 30;
constexpr std::uint64_t kUnpackedFactor = 256;

/// A child inherits the locks that other threads hold at the fork, in libhdf5 or in the allocator of a
/// sanitizer, and nobody releases them: it would wait for ever on a sound file. Another child is started
/// then.
constexpr int kAttempts = 5;

/// Returns true if another process has locked the file. HDF5 locks each file that it writes.
bool is_locked(int fd) {
  // An own description of the file: the lock that this test takes ends with it.
  const OwnedFd own(
      ::open(("/proc/self/fd/" + std::to_string(fd)).c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  return own && ::flock(own.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

double allowed_cpu_s(std::uint64_t file_bytes) {
  return kReading_s + static_cast<double>(file_bytes) / kBytesPerSecond;
}

/// The child process. It keeps no signal handler and no descriptor of the parent, except the file and the
/// pipe.
[[noreturn]] void run_child(int file, std::uint64_t file_bytes, int pipe) noexcept {
  begin_limited_child(
      file, pipe,
      static_cast<std::uint64_t>(allowed_cpu_s(file_bytes)) + 2);  // the parent counts more finely
  if (!kSanitized) limit_resource(RLIMIT_AS, address_space_bytes() + kAddressSpace);
  RecordingSender sender(kChildPipe);
  try {
    send_hdf5(
        kChildFile, file_bytes,
        [] {
          if (kSanitized) return;
          limit_resource(RLIMIT_NOFILE, 0);  // what is open stays open
          restrict_system_calls();
        },
        sender);
    ::_exit(0);
  } catch (const RecordingError& error) {
    try {
      sender.reject(error.what());
      ::_exit(0);
    } catch (const std::exception&) {  // the parent has gone
    }
  } catch (const std::exception&) {  // no memory left
  }
  ::_exit(1);
}

/// Returns true for a row that was allocated but not written when the process died. HDF5 reads it as zeros.
bool is_unwritten(const TickRow& row) {
  return row.tick.now_ns == 0 && row.tick.wrench_ready_ns == 0 && row.tick.tick == 0 && row.tick.state == 0;
}

/// Returns true if all contacts of a tick were written. A row that was allocated but not written reads as
/// zeros; a contact has a normal of unit length.
bool has_its_contacts(const TickRow& row, const std::vector<Touch>& contacts) {
  if (row.first_contact > contacts.size() || row.contact_count > contacts.size() - row.first_contact)
    return false;
  const auto first = contacts.begin() + static_cast<std::ptrdiff_t>(row.first_contact);
  return std::none_of(first, first + row.contact_count, [](const Touch& contact) {
    const auto* const bytes = reinterpret_cast<const unsigned char*>(&contact);
    return std::all_of(bytes, bytes + sizeof contact, [](unsigned char byte) { return byte == 0; });
  });
}

Recording assemble(ReceivedRecording received) {
  std::vector<TickRow>& rows = received.ticks;
  while (rows.size() > 1 && (is_unwritten(rows.back()) || !has_its_contacts(rows.back(), received.contacts)))
    rows.pop_back();
  Recording recording;
  recording.header = std::move(received.header);
  recording.contacts = std::move(received.contacts);
  recording.events = std::move(received.events);
  recording.ticks.reserve(rows.size());
  recording.contact_ranges.reserve(rows.size());
  for (const TickRow& row : rows) {
    const bool valid = has_its_contacts(row, recording.contacts);
    recording.ticks.push_back(row.tick);
    recording.contact_ranges.push_back(valid ? ContactRange{row.first_contact, row.contact_count}
                                             : ContactRange{});
  }
  return recording;
}

/// Returns true if this process has threads beside the calling one.
bool has_other_threads() {
  std::error_code ignored;
  const std::filesystem::directory_iterator threads("/proc/self/task", ignored);
  return std::distance(begin(threads), end(threads)) > 1;
}

/// Reads the recording in a child process. Throws BrokenStream if the child crashes or takes too long.
ReceivedRecording read_in_child(const OpenedFile& opened, const std::filesystem::path& file) {
  std::array<int, 2> pipe{};
  const std::string no_process = file.string() + ": cannot be read: no process can be started; try again";
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw RecordingError(no_process);
  const OwnedFd read_end(pipe[0]);
  OwnedFd write_end(pipe[1]);
  const std::uint64_t bytes = opened.size_bytes();
  const pid_t pid = ::fork();
  if (pid < 0) throw RecordingError(no_process);
  if (pid == 0) run_child(opened.fd(), bytes, write_end.get());
  const LimitedChild child(pid);
  write_end.reset();
  const auto begin = std::chrono::steady_clock::now();
  const double most_cpu_s = allowed_cpu_s(bytes);
  const auto keep_waiting = [&] {
    const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (child.cpu_s() > most_cpu_s || wall_s > kWallFactor * most_cpu_s)
      throw BrokenStream("libhdf5 takes longer than any recording of this size needs");
  };
  const std::uint64_t most = bytes < std::numeric_limits<std::uint64_t>::max() / (2 * kUnpackedFactor)
                                 ? kUnpackedBytes + kUnpackedFactor * bytes
                                 : std::numeric_limits<std::uint64_t>::max() / 2;
  return receive_recording(read_end.get(), file, most, keep_waiting);
}

}  // namespace

Recording read_recording(const std::filesystem::path& file) {
  try {
    const OpenedFile opened(file);
    return read_recording(opened, file);
  } catch (const FileError& error) {
    throw RecordingError(file.string() + ": " +
                         (error.problem() == FileProblem::missing
                              ? "does not exist; name a recording of wrenchd"
                              : error.what()));
  }
}

Recording read_recording(const OpenedFile& opened, const std::filesystem::path& file) {
  for (int left = has_other_threads() ? kAttempts : 1;; --left) {
    try {
      return assemble(read_in_child(opened, file));
    } catch (const BrokenStream&) {
      if (left == 1)
        throw RecordingError(file.string() +
                             ": is damaged: libhdf5 crashes or loops on it; use a complete copy");
    } catch (const RecordingError&) {
      if (is_locked(opened.fd()))
        throw RecordingError(file.string() +
                             ": is still being written, or another program has locked it; end the recording "
                             "with 'wrenchctl record stop', or wait for the other program, and try again");
      throw;
    }
  }
}

}  // namespace wrenchd
