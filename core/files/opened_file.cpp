// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/files/opened_file.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/files/absolute_name.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// O_NONBLOCK: opening a FIFO or a device does not wait. It has no effect on a regular file.
constexpr int kReading = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;

std::atomic<bool> fallback_only{false};

/// Closes its file descriptor on destruction.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { reset(-1); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const noexcept { return fd_; }
  void reset(int fd) noexcept {
    const int error = errno;
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
    errno = error;
  }
  int release() noexcept { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

/// Opens a path beneath a directory by openat2(2). Returns -1 with errno; ENOSYS if the kernel lacks it.
int open_by_kernel(int directory, const fs::path& beneath) {
  open_how how{};
  how.flags = kReading | O_NOFOLLOW;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS;
  constexpr int kTries = 8;  // EAGAIN: the kernel saw a rename during the walk
  long fd = -1;
  for (int i = 0; i < kTries; ++i) {
    fd = ::syscall(SYS_openat2, directory, beneath.c_str(), &how, sizeof how);
    if (fd >= 0 || (errno != EAGAIN && errno != EINTR)) break;
  }
  return static_cast<int>(fd);
}

/// Opens a path beneath a directory, one component after the other, none of which may be a link.
int open_by_components(int directory, const fs::path& beneath) {
  Descriptor at(::fcntl(directory, F_DUPFD_CLOEXEC, 0));
  for (auto part = beneath.begin(); part != beneath.end(); ++part) {
    if (*part == "..") {
      errno = EXDEV;
      return -1;
    }
    if (std::next(part) == beneath.end()) return ::openat(at.get(), part->c_str(), kReading | O_NOFOLLOW);
    const int next = ::openat(at.get(), part->c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    // O_PATH with O_NOFOLLOW opens a link itself, and O_DIRECTORY rejects it with ENOTDIR.
    if (next < 0 && errno == ENOTDIR) {
      struct stat status {};
      if (::fstatat(at.get(), part->c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 && S_ISLNK(status.st_mode))
        errno = ELOOP;
      else
        errno = ENOTDIR;
    }
    at.reset(next);
    if (next < 0) return -1;
  }
  errno = EISDIR;
  return -1;
}

int open_beneath(const fs::path& directory, const fs::path& beneath) {
  const Descriptor top(::open(directory.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (top.get() < 0) return -1;
  if (!fallback_only) {
    const int fd = open_by_kernel(top.get(), beneath);
    // EPERM, EINVAL, E2BIG: a sandbox or another kernel does not know the call with these arguments.
    if (fd >= 0 || (errno != ENOSYS && errno != EPERM && errno != EINVAL && errno != E2BIG)) return fd;
  }
  return open_by_components(top.get(), beneath);
}

[[noreturn]] void fail(int error) {
  switch (error) {
    case ENOENT:
    case ENOTDIR:
      throw FileError(FileProblem::missing, "no such file; check the name");
    case EACCES:
    case EPERM:
      throw FileError(FileProblem::denied, "cannot be opened; check that this user may read it");
    case ENXIO:  // a socket, or a FIFO or a device without a driver
    case ENODEV:
      throw FileError(FileProblem::not_regular, "is a socket or a device; name a regular file");
    case ELOOP:
    case EXDEV:
      throw FileError(FileProblem::linked,
                      "is a symbolic link, or its path contains one; name the file itself");
    default:
      throw FileError(FileProblem::unreadable, std::string("cannot be opened: ") + std::strerror(error));
  }
}

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "is a directory; name a file in it";
  if (S_ISFIFO(mode)) return "is a FIFO; name a regular file";
  if (S_ISCHR(mode)) return "is a character device; name a regular file";
  if (S_ISBLK(mode)) return "is a block device; name a regular file";
  if (S_ISSOCK(mode)) return "is a socket; name a regular file";
  return "is not a regular file; name a regular file";
}

}  // namespace

FileScope FileScope::beneath(const std::vector<fs::path>& directories) {
  FileScope scope;
  scope.directories_.emplace();
  for (const fs::path& directory : directories) {
    fs::path name = absolute_name(directory);
    if (!name.has_filename()) name = name.parent_path();  // "a/" is "a"
    const auto& known = *scope.directories_;
    // A scope of the whole file system would be none.
    if (name != name.root_path() && std::find(known.begin(), known.end(), name) == known.end())
      scope.directories_->push_back(std::move(name));
  }
  return scope;
}

std::optional<std::pair<fs::path, fs::path>> FileScope::split(const fs::path& file) const {
  const fs::path name = absolute_name(file);
  for (const fs::path& directory : *directories_) {
    const fs::path beneath = name.lexically_relative(directory);
    if (!beneath.empty() && beneath != "." && *beneath.begin() != "..") return {{directory, beneath}};
  }
  return {};
}

bool FileScope::contains(const fs::path& file) const {
  return !restricted() || split(file).has_value();
}

std::string FileScope::directories_text() const {
  std::string text;
  if (restricted())
    for (const fs::path& directory : *directories_) text += (text.empty() ? "" : ", ") + directory.string();
  return text;
}

OpenedFile::OpenedFile(const fs::path& file, const FileScope& scope) {
  if (file.native().find('\0') != std::string::npos)
    throw FileError(FileProblem::missing, "no file has a zero byte in its name; check the name");
  if (!scope.restricted()) {
    fd_ = ::open(file.c_str(), kReading);
  } else if (const auto place = scope.split(file)) {
    fd_ = open_beneath(place->first, place->second);
  } else {
    throw FileError(FileProblem::outside,
                    "is outside of the directories from which clients may load files (" +
                        scope.directories_text() +
                        "); store it there, or let an administrator name it in wrenchd.toml and reload");
  }
  if (fd_ < 0) fail(errno);
  struct stat status {};
  if (::fstat(fd_, &status) != 0) {
    const int error = errno;
    ::close(fd_);
    fail(error);
  }
  if (!S_ISREG(status.st_mode)) {
    ::close(fd_);
    throw FileError(FileProblem::not_regular, kind_of(status.st_mode));
  }
  size_bytes_ = static_cast<std::uint64_t>(status.st_size);
}

OpenedFile::~OpenedFile() {
  if (fd_ >= 0) ::close(fd_);
}

OpenedFile::OpenedFile(OpenedFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), size_bytes_(other.size_bytes_) {}

/// Files of /proc and /sys state a size that is not theirs, so the end of the file counts.
std::string OpenedFile::read(std::uint64_t most_bytes) {
  constexpr std::uint64_t kPiece = 4096;
  const auto reject = [] { throw FileError(FileProblem::too_large, "is too large"); };
  if (size_bytes_ > most_bytes) reject();
  std::string bytes(static_cast<std::size_t>(size_bytes_) + kPiece, '\0');
  std::size_t used = 0;
  while (true) {
    if (used == bytes.size()) bytes.resize(2 * bytes.size());
    const ssize_t got = ::read(fd_, bytes.data() + used, bytes.size() - used);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      throw FileError(FileProblem::unreadable, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
    if (used > most_bytes) reject();
  }
  bytes.resize(used);
  return bytes;
}

std::string OpenedFile::peek(std::size_t bytes) const {
  std::string head(bytes, '\0');
  const ssize_t got = ::pread(fd_, head.data(), head.size(), 0);
  if (got < 0)
    throw FileError(FileProblem::unreadable, std::string("cannot be read: ") + std::strerror(errno));
  head.resize(static_cast<std::size_t>(got));
  return head;
}

void OpenedFile::use_fallback(bool wanted) noexcept {
  fallback_only = wanted;
}

std::string read_file(const fs::path& file, std::uint64_t most_bytes, const FileScope& scope) {
  return OpenedFile(file, scope).read(most_bytes);
}

std::optional<std::string> read_file_if_readable(const fs::path& file, std::uint64_t most_bytes) {
  try {
    return read_file(file, most_bytes);
  } catch (const FileError&) {
    return {};
  }
}

}  // namespace wrenchd
