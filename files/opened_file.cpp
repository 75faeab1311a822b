// SPDX-License-Identifier: GPL-3.0-or-later
#include "files/opened_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

using Reason = FileError::Reason;

/// O_NONBLOCK: the open of a FIFO without a writer, or of a file that another program holds a lease on,
/// returns at once. O_NOCTTY: a terminal does not become the controlling one.
constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
constexpr std::size_t kReadBytes = std::size_t{1} << 20;

fs::path normal(const fs::path& file) {
  std::error_code error;  // the working directory may be gone
  fs::path path = fs::absolute(file, error).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "/etc/wrenchd/" is "/etc/wrenchd"
  return path;
}

OwnedFd open_by_steps(OwnedFd directory, const fs::path& relative, int flags) {
  for (auto part = relative.begin(); part != relative.end(); ++part) {
    if (*part == "..") {
      errno = EXDEV;
      return {};
    }
    const bool last = std::next(part) == relative.end();
    OwnedFd next(::openat(directory.get(), part->c_str(),
                          last ? flags | O_NOFOLLOW : O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (!next) {
      // A link that is no directory: the kernel reports ENOTDIR for O_DIRECTORY, before ELOOP.
      struct stat status {};
      const int error = errno;
      const bool link = ::fstatat(directory.get(), part->c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 &&
                        S_ISLNK(status.st_mode);
      errno = link ? ELOOP : error;
      return {};
    }
    directory = std::move(next);
  }
  return directory;
}

[[noreturn]] void reject_errno(int error) {
  switch (error) {
    case ENOENT:
    case ENOTDIR:
      throw FileError(Reason::not_found, "no such file");
    case ELOOP:
      throw FileError(Reason::link, "is a symbolic link, or lies behind one, which is not followed here");
    case EXDEV:
      throw FileError(Reason::outside, "leaves the directories that it may be in");
    case EWOULDBLOCK:
      throw FileError(Reason::unreadable, "is held by another program; try again when it has finished");
    case ENXIO:
      throw FileError(Reason::not_regular, "is not a regular file");
    default:
      throw FileError(Reason::unreadable, std::string("cannot be opened: ") + std::strerror(error));
  }
}

OwnedFd open_in(const fs::path& file, const FileScope& scope) {
  if (!scope.is_limited()) return OwnedFd(::open(file.c_str(), kFlags));
  const fs::path directory = scope.directory_of(file);
  if (directory.empty())
    throw FileError(Reason::outside, "is outside the directories that it may be in: " + scope.text());
  return open_beneath(directory, normal(file).lexically_relative(directory), kFlags);
}

}  // namespace

FileScope FileScope::beneath(std::vector<fs::path> directories) {
  FileScope scope;
  scope.limited_ = true;
  for (const fs::path& directory : directories) {
    fs::path path = normal(directory);
    // Beneath the root is everything, which no list of directories means.
    if (directory.empty() || path == path.root_path()) continue;
    if (std::find(scope.directories_.begin(), scope.directories_.end(), path) == scope.directories_.end())
      scope.directories_.push_back(std::move(path));
  }
  return scope;
}

fs::path FileScope::directory_of(const fs::path& file) const {
  if (file.empty() || file.native().find('\0') != std::string::npos) return {};
  const fs::path path = normal(file);
  for (const fs::path& directory : directories_) {
    const auto [in_directory, in_path] =
        std::mismatch(directory.begin(), directory.end(), path.begin(), path.end());
    if (in_directory == directory.end() && in_path != path.end()) return directory;
  }
  return {};
}

bool FileScope::includes(const fs::path& file) const {
  return !limited_ || !directory_of(file).empty();
}

std::string FileScope::text() const {
  std::string text;
  for (const fs::path& directory : directories_) text += (text.empty() ? "" : ", ") + directory.string();
  return text.empty() ? "none" : text;
}

OwnedFd open_beneath(const fs::path& directory, const fs::path& relative, int flags, BeneathBy by) {
  OwnedFd at(::open(directory.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!at) return {};
  if (by == BeneathBy::kernel) {
    open_how how{};
    how.flags = static_cast<std::uint64_t>(flags | O_NOFOLLOW);
    how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;
    OwnedFd fd(static_cast<int>(::syscall(SYS_openat2, at.get(), relative.c_str(), &how, sizeof how)));
    // EPERM: a filter of system calls does not know this one.
    if (fd || (errno != ENOSYS && errno != EPERM)) return fd;
  }
  return open_by_steps(std::move(at), relative, flags);
}

OpenedFile::OpenedFile(const fs::path& file, std::uint64_t max_bytes, const FileScope& scope)
    : fd_(open_in(file, scope)), max_bytes_(max_bytes) {
  if (!fd_) reject_errno(errno);
  struct stat status {};
  if (::fstat(fd_.get(), &status) != 0) reject_errno(errno);
  if (S_ISDIR(status.st_mode)) throw FileError(Reason::directory, "is a directory");
  if (!S_ISREG(status.st_mode)) throw FileError(Reason::not_regular, "is not a regular file");
  size_bytes_ = static_cast<std::uint64_t>(status.st_size);
  if (size_bytes_ > max_bytes_) throw FileError(Reason::too_large, "is too large");
}

std::string OpenedFile::read() const {
  std::string bytes;
  bytes.resize(size_bytes_);
  std::uint64_t size = 0;
  for (;;) {
    if (size == bytes.size()) {  // also at the expected end: the next read finds whether there is more
      if (size > max_bytes_) throw FileError(Reason::too_large, "is too large");
      bytes.resize(size + std::min<std::uint64_t>(kReadBytes, max_bytes_ - size + 1));
    }
    const ssize_t got =
        ::pread(fd_.get(), bytes.data() + size, bytes.size() - size, static_cast<off_t>(size));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw FileError(Reason::unreadable, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;
    size += static_cast<std::uint64_t>(got);
  }
  if (size > max_bytes_) throw FileError(Reason::too_large, "is too large");
  bytes.resize(size);
  return bytes;
}

std::string read_file(const fs::path& file, std::uint64_t max_bytes, const FileScope& scope) {
  return OpenedFile(file, max_bytes, scope).read();
}

}  // namespace wrenchd
