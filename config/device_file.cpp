// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/device_file.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include <boost/crc.hpp>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "config/config_error.hpp"
#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFileBytes = 1 << 16;
/// bytes of a file name, with room for the suffix of a temporary file
constexpr std::size_t kMaxNameBytes = 240;

std::string checksum_line(std::string_view text) {
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  std::array<char, 24> line{};
  std::snprintf(line.data(), line.size(), "# crc32 %08x\n", static_cast<unsigned>(crc.checksum()));
  return line.data();
}

/// Owns a file descriptor and closes it; -1: none.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { close_now(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const noexcept { return fd_; }
  bool close_now() noexcept {
    const bool good = fd_ < 0 || ::close(fd_) == 0;
    fd_ = -1;
    return good;
  }

 private:
  int fd_;
};

[[noreturn]] void cannot_write(const fs::path& file, const char* what) {
  throw std::runtime_error(file.string() + ": cannot be written (" + what + ": " + std::strerror(errno) +
                           "); check that its directory may be written to and that the disk has room");
}

bool write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t put = ::write(fd, text.data(), text.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(put));
  }
  return true;
}

/// A temporary file beside its target. Destroys the file if it was not renamed to the target.
class TemporaryFile {
 public:
  explicit TemporaryFile(const fs::path& file)
      : file_(file),
        beside_((file.parent_path() / ("." + file.filename().string() + ".XXXXXX.part")).string()),
        out_(::mkostemps(beside_.data(), 5, O_CLOEXEC)) {
    if (out_.get() < 0) cannot_write(file_, "making a file beside it");
  }
  ~TemporaryFile() {
    if (!put_) ::unlink(beside_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Flushes the data to disk before the rename. Otherwise a crash could leave the new name with incomplete
  /// data.
  void fill(std::string_view text) {
    if (!write_all(out_.get(), text)) cannot_write(file_, "writing");
    if (::fchmod(out_.get(), 0644) != 0) cannot_write(file_, "giving it its mode");
    if (::fdatasync(out_.get()) != 0) cannot_write(file_, "bringing it to the disk");
    if (!out_.close_now()) cannot_write(file_, "closing");
  }

  void put_in_place() {
    if (::rename(beside_.c_str(), file_.c_str()) != 0) cannot_write(file_, "putting it in its place");
    put_ = true;
    const Descriptor directory(::open(file_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (directory.get() < 0 || ::fsync(directory.get()) != 0)
      cannot_write(file_, "bringing its name to the disk");
  }

 private:
  fs::path file_;
  std::string beside_;
  Descriptor out_;
  bool put_ = false;
};

}  // namespace

fs::path state_directory() {
  const char* given = std::getenv("STATE_DIRECTORY");
  const std::string list = given != nullptr ? given : "";
  const std::string first = list.substr(0, list.find(':'));
  return first.empty() ? "/var/lib/wrenchd" : fs::path(first);
}

bool is_letter_or_digit(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

std::string encoded_device_name(std::string_view bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char c = bytes[i];
    if (is_letter_or_digit(c) || c == '_' || c == '-' || (c == '.' && i > 0)) {
      text += c;
      continue;
    }
    std::array<char, 4> code{};
    std::snprintf(code.data(), code.size(), "%%%02X", static_cast<unsigned>(static_cast<unsigned char>(c)));
    text += code.data();
  }
  return text;
}

fs::path device_file(const fs::path& directory, std::string_view kind, std::string_view profile,
                     std::string_view serial) {
  const std::string begin = std::string(kind) + ": ";
  if (profile.empty()) throw std::invalid_argument(begin + "the profile has no name; give it one");
  if (serial.empty())
    throw std::invalid_argument(begin +
                                "the device has no serial number, so it cannot be distinguished from other "
                                "devices of its model; nothing can be kept for it");
  const std::string name = encoded_device_name(profile) + "@" + encoded_device_name(serial) + ".toml";
  if (name.size() > kMaxNameBytes)
    throw std::invalid_argument(begin +
                                "profile name and serial number together are too long for a file name: '" +
                                printable(name) + "'");
  return directory / name;
}

std::string with_checksum(const std::string& text) {
  return text + checksum_line(text);
}

bool has_valid_checksum(const std::string& text) {
  const std::size_t length = checksum_line("").size();
  if (text.size() <= length) return false;
  const std::string_view body = std::string_view(text).substr(0, text.size() - length);
  return body.ends_with('\n') && std::string_view(text).substr(body.size()) == checksum_line(body);
}

std::optional<std::string> read_device_file(const fs::path& file, const std::string& cure) {
  const Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (in.get() < 0 && errno == ENOENT) return {};
  if (in.get() < 0)
    throw ConfigError(file, {},
                      std::string("cannot be opened: ") + std::strerror(errno) + "; check who may read it");
  struct stat status {};
  if (::fstat(in.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw ConfigError(file, {}, "is not a regular file" + cure);
  std::string content(kMostFileBytes + 1, '\0');
  std::size_t size = 0;
  while (size < content.size()) {
    const ssize_t got = ::read(in.get(), content.data() + size, content.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw ConfigError(file, {}, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  if (size > kMostFileBytes) throw ConfigError(file, {}, "is larger than 64 KiB" + cure);
  content.resize(size);
  return content;
}

void write_device_file(const fs::path& file, std::string_view text) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error)
    throw std::runtime_error(file.parent_path().string() + ": cannot be made (" + error.message() +
                             "); make it, or set STATE_DIRECTORY to a directory that may be written to");
  TemporaryFile beside(file);
  beside.fill(text);
  beside.put_in_place();
}

}  // namespace wrenchd
