// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/calibration_store.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <set>
#include <stdexcept>

#include <boost/crc.hpp>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "config/toml_reader.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTitle = "# wrenchd calibration ";
constexpr int kFormat = 1;
constexpr std::size_t kMostBytes = 1 << 16;
constexpr std::size_t kMostOffsets = 32;
constexpr std::size_t kLongestAxis = 32;
/// bytes of a file name, with room for the suffix of a temporary file
constexpr std::size_t kMaxNameBytes = 240;
constexpr double kMaxOffset = 1e4;  ///< [m] or [rad]; no valid offset is larger

constexpr const char* kCure = "; remove it and calibrate the device again";

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

// Names. Any bytes are accepted; the result is valid as a file name and as a TOML string.

std::string encoded(std::string_view bytes) {
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

bool is_axis_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestAxis && std::all_of(name.begin(), name.end(), [](char c) {
    return is_letter_or_digit(c) || c == '_' || c == '-';
  });
}

// The text of a file

std::string checksum_line(std::string_view text) {
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  std::array<char, 24> line{};
  std::snprintf(line.data(), line.size(), "# crc32 %08x\n", static_cast<unsigned>(crc.checksum()));
  return line.data();
}

/// The first line states the format; it distinguishes a file of another version or program from a damaged
/// one.
void require_title(const std::string& text, const fs::path& file) {
  const std::string expected = std::string(kTitle) + std::to_string(kFormat) + "\n";
  if (text.starts_with(expected)) return;
  if (text.starts_with(kTitle) && text.find('\n') != std::string::npos)
    throw ConfigError(file, {1, 1},
                      "is a calibration of format " +
                          printable(text.substr(kTitle.size(), text.find('\n') - kTitle.size()), 20) +
                          ", and this wrenchd supports format " + std::to_string(kFormat) + kCure);
  throw ConfigError(file, {}, std::string("is no calibration of a device, or is damaged") + kCure);
}

void require_checksum(const std::string& text, const fs::path& file) {
  const std::size_t length = checksum_line("").size();
  if (text.size() > length) {
    const std::string_view body = std::string_view(text).substr(0, text.size() - length);
    if (body.ends_with('\n') && std::string_view(text).substr(body.size()) == checksum_line(body)) return;
  }
  throw ConfigError(file, {}, std::string("is damaged: its checksum does not fit") + kCure);
}

void read_offset(TomlTable& table, AxisOffset& offset) {
  table.mandatory("axis").text(offset.axis);
  table.mandatory("value").number(offset.offset, {-kMaxOffset, kMaxOffset});
}

void read_calibration(TomlTable& table, Calibration& calibration) {
  table.mandatory("profile").text(calibration.profile);
  table.mandatory("serial").text(calibration.serial);
  const TomlValue offsets = table.optional("offset");
  for (const TomlValue& element : offsets.elements("tables [[offset]]"))
    element.table(read_offset, calibration.offsets.emplace_back());
}

/// Description of the first defect of a calibration; empty if it is valid.
std::string defect_of(const Calibration& calibration) {
  if (calibration.offsets.size() > kMostOffsets)
    return "more than " + std::to_string(kMostOffsets) + " axes have an offset";
  std::set<std::string> seen;
  for (const AxisOffset& offset : calibration.offsets) {
    if (!is_axis_name(offset.axis)) return "'" + printable(offset.axis) + "' is no name of an axis";
    if (!seen.insert(offset.axis).second) return "axis '" + offset.axis + "' has two offsets";
    if (!is_finite(offset.offset) || std::abs(offset.offset) > kMaxOffset)
      return "the offset of axis '" + offset.axis + "' is not within 10,000 m or rad";
  }
  return {};
}

// Files

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

/// The bytes of a file; empty if it does not exist.
std::optional<std::string> content_of(const fs::path& file) {
  const Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (in.get() < 0 && errno == ENOENT) return {};
  if (in.get() < 0)
    throw ConfigError(file, {},
                      std::string("cannot be opened: ") + std::strerror(errno) + "; check who may read it");
  struct stat status {};
  if (::fstat(in.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw ConfigError(file, {}, std::string("is not a regular file") + kCure);
  std::string content(kMostBytes + 1, '\0');
  std::size_t size = 0;
  while (size < content.size()) {
    const ssize_t got = ::read(in.get(), content.data() + size, content.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw ConfigError(file, {}, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  if (size > kMostBytes) throw ConfigError(file, {}, std::string("is larger than 64 KiB") + kCure);
  content.resize(size);
  return content;
}

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

std::string to_text(const Calibration& calibration) {
  std::string text = std::string(kTitle) + std::to_string(kFormat) + "\nprofile = \"" +
                     encoded(calibration.profile) + "\"\nserial = \"" + encoded(calibration.serial) + "\"\n";
  for (const AxisOffset& offset : calibration.offsets)
    text += "[[offset]]\naxis = \"" + offset.axis + "\"\nvalue = " + to_text(offset.offset) + "\n";
  return text + checksum_line(text);
}

Calibration parse_calibration(const std::string& text, const fs::path& file) {
  require_title(text, file);
  require_checksum(text, file);
  Calibration calibration;
  read_toml_text(text, file, read_calibration, calibration);
  if (const std::string fault = defect_of(calibration); !fault.empty())
    throw ConfigError(file, {}, "cannot be used: " + fault + kCure);
  return calibration;
}

std::optional<Calibration> CalibrationStore::read(const std::string& profile,
                                                  const std::string& serial) const {
  const fs::path file = file_of(profile, serial);
  const auto text = content_of(file);
  if (!text) return {};
  Calibration calibration = parse_calibration(*text, file);
  if (calibration.profile != encoded(profile) || calibration.serial != encoded(serial))
    throw ConfigError(file, {},
                      "is of device '" + printable(calibration.serial) + "' with profile '" +
                          printable(calibration.profile) + "'" + kCure);
  calibration.profile = profile;
  calibration.serial = serial;
  return calibration;
}

void CalibrationStore::write(const Calibration& calibration) const {
  const fs::path file = file_of(calibration.profile, calibration.serial);
  if (const std::string fault = defect_of(calibration); !fault.empty())
    throw std::invalid_argument("calibration of '" + printable(calibration.serial) + "': " + fault);
  std::error_code error;
  fs::create_directories(directory_, error);
  if (error)
    throw std::runtime_error(directory_.string() + ": cannot be made (" + error.message() +
                             "); make it, or set STATE_DIRECTORY to a directory that may be written to");
  TemporaryFile beside(file);
  beside.fill(to_text(calibration));
  beside.put_in_place();
}

fs::path CalibrationStore::file_of(std::string_view profile, std::string_view serial) const {
  if (profile.empty()) throw std::invalid_argument("calibration: the profile has no name; give it one");
  if (serial.empty())
    throw std::invalid_argument(
        "calibration: the device has no serial number, so it cannot be distinguished from other devices of "
        "its model; its calibration "
        "cannot be kept");
  const std::string name = encoded(profile) + "@" + encoded(serial) + ".toml";
  if (name.size() > kMaxNameBytes)
    throw std::invalid_argument(
        "calibration: profile name and serial number together are too long for a file "
        "name: '" +
        printable(name) + "'");
  return directory_ / name;
}

}  // namespace wrenchd
