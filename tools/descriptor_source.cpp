// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/descriptor_source.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <linux/hidraw.h>
#include <linux/input.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "config/config_error.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Maximum size of a text file: well above a hexadecimal descriptor with a comment on every byte.
constexpr std::size_t kMaxTextBytes = 1 << 20;

[[noreturn]] void reject(const fs::path& file, const std::string& why) {
  throw std::runtime_error(file.string() + ": " + why);
}

constexpr std::string_view kBlanks = " \t\r\n,";

/// A binary descriptor always contains a byte below 0x20, because its first item is a usage page, a usage or
/// the start of a collection. A text contains only tabs and line ends below 0x20.
bool is_text(std::string_view content) {
  return std::all_of(content.begin(), content.end(),
                     [](char c) { return kBlanks.find(c) != kBlanks.npos || (c > ' ' && c <= '~'); });
}

/// A file or a device that is opened once. Closes its file descriptor on destruction.
class OpenSource {
 public:
  explicit OpenSource(const fs::path& file)
      : fd_(open(file.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)) {}
  ~OpenSource() {
    if (fd_ >= 0) close(fd_);
  }
  OpenSource(const OpenSource&) = delete;
  OpenSource& operator=(const OpenSource&) = delete;
  int fd() const noexcept { return fd_; }

 private:
  int fd_;
};

void take_device(int fd, DescriptorSource& source) {
  hidraw_devinfo info{};
  std::array<char, 256> name{};
  if (ioctl(fd, HIDIOCGRAWINFO, &info) < 0) return;
  if (ioctl(fd, HIDIOCGRAWNAME(name.size() - 1), name.data()) < 0) name[0] = '\0';
  std::array<char, 32> ids{};
  const char* bus = info.bustype == BUS_USB ? "usb" : info.bustype == BUS_BLUETOOTH ? "bluetooth" : "bus";
  const UsbId id = {static_cast<std::uint16_t>(info.vendor), static_cast<std::uint16_t>(info.product)};
  std::snprintf(ids.data(), ids.size(), "%s %04x:%04x", bus, unsigned{id.vendor}, unsigned{id.product});
  source.id = id;
  source.device = std::string(ids.data()) + (name[0] == '\0' ? "" : ", \"" + printable(name.data()) + '"');
}

DescriptorSource ask_kernel(const OpenSource& node, const fs::path& file) {
  int size = 0;
  if (ioctl(node.fd(), HIDIOCGRDESCSIZE, &size) < 0)
    reject(file, "is not a hidraw device; name a /dev/hidrawN, or a file with a report descriptor");
  hidraw_report_descriptor descriptor{};
  descriptor.size = static_cast<unsigned>(std::clamp(size, 0, HID_MAX_DESCRIPTOR_SIZE));
  if (ioctl(node.fd(), HIDIOCGRDESC, &descriptor) < 0)
    reject(file, std::string("the kernel does not provide its report descriptor: ") + std::strerror(errno));
  DescriptorSource source{{descriptor.value, descriptor.value + descriptor.size}, file.string(), {}, {}};
  take_device(node.fd(), source);
  return source;
}

/// Reads until the end, because files in /sys have no known size.
std::string content_of(const OpenSource& source, const fs::path& file) {
  std::string content(kMaxTextBytes + 1, '\0');
  std::size_t used = 0;
  while (used < content.size()) {
    const ssize_t got = read(source.fd(), content.data() + used, content.size() - used);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) reject(file, std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
  }
  content.resize(used);
  if (content.size() > kMaxTextBytes)
    reject(file, "is larger than 1 MiB; a report descriptor has at most 4096 bytes");
  if (content.empty()) reject(file, "is empty; check whether the device is still connected");
  return content;
}

/// Parses "05", "0x05" or "05010908".
void add_bytes_of_word(std::string_view word, const std::string& place, std::vector<std::uint8_t>& bytes) {
  std::string_view digits = word;
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  const bool good = !digits.empty() && digits.size() % 2 == 0 &&
                    digits.find_first_not_of("0123456789abcdefABCDEF") == std::string_view::npos;
  if (!good)
    throw std::runtime_error(place +
                             ": expected bytes with two hexadecimal digits, as in 05 01 or 0x05, 0x01; " +
                             "found '" + printable(std::string(word), 20) + "'");
  for (std::size_t k = 0; k < digits.size(); k += 2) {
    std::uint8_t byte = 0;
    std::from_chars(digits.data() + k, digits.data() + k + 2, byte, 16);
    bytes.push_back(byte);
  }
}

void add_bytes_of_line(std::string_view text, std::size_t line, std::vector<std::uint8_t>& bytes) {
  text = text.substr(0, std::min(text.find('#'), text.find("//")));
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t end = std::min(text.find_first_of(kBlanks, i), text.size());
    const std::string place = std::to_string(line) + ":" + std::to_string(i + 1);
    if (end > i) add_bytes_of_word(text.substr(i, end - i), place, bytes);
    i = end + 1;
  }
}

}  // namespace

std::vector<std::uint8_t> parse_hex_text(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t length = std::min(text.find('\n'), text.size());
    add_bytes_of_line(text.substr(0, length), line, bytes);
    text.remove_prefix(std::min(length + 1, text.size()));
  }
  return bytes;
}

DescriptorSource read_descriptor_source(const fs::path& file) {
  const OpenSource source(file);
  if (source.fd() < 0 && errno == ENOENT)
    reject(file, "no such file; name a /dev/hidrawN, or a file with a report descriptor");
  if (source.fd() < 0 && (errno == EACCES || errno == EPERM))
    reject(file, "cannot be opened by this user; run as root, or grant access with a udev rule");
  if (source.fd() < 0) reject(file, std::string("cannot be opened: ") + std::strerror(errno));
  struct stat status {};
  if (fstat(source.fd(), &status) != 0) reject(file, std::string("cannot be read: ") + std::strerror(errno));
  if (S_ISCHR(status.st_mode)) return ask_kernel(source, file);
  if (!S_ISREG(status.st_mode))
    reject(file,
           "is neither a hidraw device nor a regular file; name a /dev/hidrawN, or a file with a report "
           "descriptor");
  const std::string content = content_of(source, file);
  if (!is_text(content)) return {{content.begin(), content.end()}, file.string(), {}, {}};
  try {
    return {parse_hex_text(content), file.string(), {}, {}};
  } catch (const std::runtime_error& wrong) {
    throw std::runtime_error(file.string() + ":" + wrong.what());
  }
}

ReportDescriptor parse_descriptor(const DescriptorSource& source) {
  try {
    return parse_report_descriptor(source.bytes);
  } catch (const DescriptorError& error) {
    throw std::runtime_error(source.file + ": report descriptor, " + error.what());
  }
}

}  // namespace wrenchd
