// SPDX-License-Identifier: GPL-3.0-or-later
#include <cerrno>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <sys/file.h>
#include <sys/mman.h>

#include "daemon/recording/limited_child.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/recording/recording_stream.hpp"
#include "files/opened_file.hpp"

// libhdf5 is not made for hostile files: damaged ones crash it, or make it loop. So this process never gives
// it a file that it did not write itself. A child reads the file once, under limits, and streams plain rows
// and texts (daemon/README.md, "Recordings of others").

namespace wrenchd {
namespace {

/// Largest recording: 2 TiB.
constexpr std::uint64_t kMaxFile_bytes = std::uint64_t{1} << 41;
/// Processor time for a file: a constant, and a time by size. The constant is short, so that a file that makes
/// libhdf5 loop is reported within 2 s on a busy machine, too.
constexpr double kCpu_s = 0.25;
constexpr double kCpu_bytes_per_s = 4e6;
constexpr double kSilence_s = 60.0;
constexpr std::uint64_t kMemory_bytes = std::uint64_t{512} << 20;
/// Largest expansion of DEFLATE, and room for texts.
constexpr std::uint64_t kMaxExpansion = 1032;
constexpr std::uint64_t kTexts_bytes = std::uint64_t{1} << 20;

/// The bytes of an open file. The copy is private: a change of the file by another program may or may not
/// show.
class MappedFile {
 public:
  explicit MappedFile(const OpenedFile& file) : size_(file.size_bytes()) {
    if (size_ == 0) return;
    void* const at =
        ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_NORESERVE, file.fd(), 0);
    if (at != MAP_FAILED) at_ = static_cast<const char*>(at);
  }
  ~MappedFile() {
    if (at_ != nullptr) ::munmap(const_cast<char*>(at_), size_);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  bool ok() const noexcept { return at_ != nullptr || size_ == 0; }
  std::span<const char> bytes() const noexcept { return {at_, at_ == nullptr ? 0 : size_}; }

 private:
  std::size_t size_;
  const char* at_ = nullptr;
};

OpenedFile open_recording_file(const std::filesystem::path& file) {
  try {
    return {file, kMaxFile_bytes};
  } catch (const FileError& error) {
    throw RecordingError(file.string() + ": " +
                         (error.reason() == FileError::Reason::not_found ? "does not exist" : error.what()) +
                         "; name a recording of wrenchd");
  }
}

}  // namespace

Recording read_recording(const std::filesystem::path& file) {
  const OpenedFile opened = open_recording_file(file);
  if (::flock(opened.fd(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw RecordingError(file.string() +
                         ": is still being written, or another program holds a lock on it; end the recording "
                         "first ('wrenchctl record stop')");
  const std::uint64_t bytes = opened.size_bytes();
  const MappedFile mapped(opened);
  if (!mapped.ok())
    throw RecordingError(file.string() + ": cannot be read; it needs more memory than there is");
  RecordingDecoder decoder(file.string(), kTexts_bytes + bytes * kMaxExpansion);
  ChildLimits limits;
  limits.cpu_s = kCpu_s + static_cast<double>(bytes) / kCpu_bytes_per_s;
  limits.wall_s = kSilence_s;
  limits.memory_bytes = kMemory_bytes + 2 * bytes;
  // The child must not wait for a lock that another thread holds in this process, or find a table half made.
  std::optional<std::scoped_lock<std::mutex>> lock(std::in_place, hdf5_mutex());
  initialize_hdf5();
  tick_table(), contact_table();
  const ChildEnd end = run_limited_child(
      limits,
      [&mapped](const auto& write) {
        RecordingEncoder out(write);
        parse_recording(mapped.bytes(), out);
      },
      [&](std::string_view part) {
        lock.reset();  // the child runs
        return decoder.feed(part);
      });
  if (end.out_of_time)
    throw RecordingError(file.string() + ": is damaged: reading it does not end; use a complete copy");
  if (!decoder.complete())
    throw RecordingError(file.string() + ": is damaged: reading it made libhdf5 fail" +
                         (end.signal != 0 ? " (signal " + std::to_string(end.signal) + ")" : "") +
                         "; use a complete copy");
  return decoder.take();
}

}  // namespace wrenchd
