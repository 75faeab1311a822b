// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/hidraw_link.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <hidapi/hidapi.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "devices/links/wake_up.hpp"

namespace wrenchd {

/// The kernel returns the number of bytes that it wrote, including the report id. A device that took less did
/// not get the report.
LinkStatus write_status(int written, std::size_t expected, int error) noexcept {
  if (written >= 0 && static_cast<std::size_t>(written) == expected) return LinkStatus::ok;
  const bool gone = written < 0 && (error == ENODEV || error == EIO);
  return gone ? LinkStatus::disconnected : LinkStatus::not_ready;
}

namespace {

/// The open and close functions of hidapi are not thread-safe: they share one error text.
std::mutex& hidapi_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::set<int> open_fds() {
  std::set<int> files;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    files.insert(std::atoi(entry.path().filename().c_str()));
  std::erase_if(files, [](int file) {
    return fcntl(file, F_GETFD) < 0;
  });  // removes the descriptor of the directory itself
  return files;
}

/// Returns the file descriptor that hidapi opened for the node and does not expose: one that was not open
/// before and refers to the node. -1 if there is none.
int find_opened_fd(const std::string& node, const std::set<int>& before) {
  struct stat expected {};
  if (stat(node.c_str(), &expected) != 0) return -1;
  for (const int file : open_fds()) {
    struct stat found {};
    if (before.count(file) == 0 && fstat(file, &found) == 0 && found.st_dev == expected.st_dev &&
        found.st_ino == expected.st_ino)
      return file;
  }
  return -1;
}

/// Throws if another device is behind the node now. The node must be open: the kernel does not reassign its
/// number until it is closed.
void check_identity(const UsbDevice& expected) {
  for (const UsbDevice& found : list_usb_devices()) {
    if (found.hidraw_node != expected.hidraw_node) continue;
    if (found.is_same_device(expected)) return;
    throw std::runtime_error(expected.hidraw_node + " is " + describe(found) + ", not " + describe(expected) +
                             ": nothing was written to it; search for the device again");
  }
  throw std::runtime_error(open_error(expected, expected.hidraw_node, ENODEV));
}

}  // namespace

void HidrawLink::CloseHid::operator()(hid_device_* device) const noexcept {
  const std::lock_guard lock(hidapi_mutex());
  hid_close(device);
}

HidrawLink::HidrawLink(UsbDevice device, LinkSettings settings)
    : device_(std::move(device)), settings_(std::move(settings)), declared_(device_.report_descriptor) {}

void HidrawLink::open() {
  close();
  const std::string& node = device_.hidraw_node;
  if (node.empty())
    throw std::runtime_error(describe(device_) + " has no hidraw node: it is not a HID device; use libusb");
  const auto open_node = [&] {
    Hid hid(hid_open_path(node.c_str()));
    if (!hid) {
      const int error = errno;
      const std::string why = open_error(device_, node);
      throw std::runtime_error(why.empty() ? open_error(device_, node, error) : why);
    }
    return hid;
  };
  // One handle per thread: hidapi stores an error text in each handle, so reader and writer must not share
  // one.
  Hid writing;
  {
    std::unique_lock lock(hidapi_mutex());
    Hid reading;
    try {
      const std::set<int> before = open_fds();
      reading = open_node();
      fd_ = find_opened_fd(node, before);
      writing = open_node();
    } catch (...) {
      lock.unlock();  // the destructor of Hid takes the lock
      throw;
    }
    reader_ = std::move(reading);
  }
  if (fd_ < 0) {
    reader_.reset();
    throw std::runtime_error("cannot find the file that hidapi opened for " + node + "; is /proc mounted?");
  }
  // The kernel lets several programs write to a HID device. The lock prevents two hosts from driving one
  // device.
  if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno == EWOULDBLOCK ? EBUSY : errno;
    reader_.reset();
    fd_ = -1;
    throw std::runtime_error(open_error(device_, node, error));
  }
  try {
    check_identity(device_);
    writer_.emplace(
        [hid = std::shared_ptr<hid_device_>(std::move(writing)), numbered = device_.numbered_reports](
            auto report) { return write_blocking(hid.get(), numbered, report); },
        settings_);
  } catch (...) {
    reader_.reset();
    fd_ = -1;
    throw;
  }
  disconnected_ = false;
  last_seen_empty_.reset();
  taken_since_empty_ = 0;
}

LinkRead HidrawLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  if (!reader_ || disconnected_) return {LinkStatus::disconnected, 0, now};
  // hidapi also polls, but allocates an error text on failure. After unplugging, the kernel still delivers
  // the waiting reports.
  pollfd ready{fd_, POLLIN, 0};
  if (poll(&ready, 1, 0) > 0 && (ready.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0)
    return mark_disconnected(now);
  const int length =
      (ready.revents & POLLIN) == 0 ? 0 : hid_read_timeout(reader_.get(), bytes_.data(), bytes_.size(), 0);
  if (length < 0) return mark_disconnected(now);
  if (length == 0) {
    last_seen_empty_ = now;
    taken_since_empty_ = 0;
    return {LinkStatus::not_ready, 0, now};
  }
  const auto n = static_cast<std::size_t>(length);
  std::copy_n(bytes_.begin(), std::min(n, buffer.size()), buffer.begin());
  taken_since_empty_ = std::min(taken_since_empty_ + 1, kKernelRingCapacity);
  const bool ring_was_full = taken_since_empty_ == kKernelRingCapacity && last_seen_empty_;
  return {LinkStatus::ok, n, ring_was_full ? *last_seen_empty_ : now};
}

LinkRead HidrawLink::mark_disconnected(TimePoint now) noexcept {
  disconnected_ = true;
  return {LinkStatus::disconnected, 0, now};
}

LinkStatus HidrawLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  if (!writer_ || disconnected_) return LinkStatus::disconnected;
  return writer_->submit(now, report);
}

/// Runs on the writer thread.
LinkStatus HidrawLink::write_blocking(hid_device_* hid, bool numbered, std::span<const std::uint8_t> report) {
  std::array<std::uint8_t, kMaxReportBytes + 1> framed{};
  const std::size_t head = numbered ? 0 : 1;
  std::copy(report.begin(), report.end(), framed.begin() + static_cast<std::ptrdiff_t>(head));
  errno = 0;
  return write_status(hid_write(hid, framed.data(), head + report.size()), head + report.size(), errno);
}

void HidrawLink::wait_readable(TimePoint deadline) noexcept {
  if (reader_ && !disconnected_) wait_for_fd(fd_, POLLIN, deadline);
}

void HidrawLink::close() noexcept {
  const bool written = !writer_ || writer_->close();
  writer_.reset();
  // While a write is stuck, the kernel keeps every other file of the node from being closed.
  if (!written && reader_ && !disconnected_) close_later(std::move(reader_), fd_);
  reader_.reset();
  fd_ = -1;
}

/// Replacing the file waits for the kernel without hidapi's lock, which other devices of this process need.
void HidrawLink::close_later(Hid hid, int fd) noexcept {
  try {
    std::thread([later = std::move(hid), fd]() mutable {
      const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
      if (nothing >= 0) {
        dup3(nothing, fd, O_CLOEXEC);
        ::close(nothing);
      }
      later.reset();
    }).detach();
  } catch (const std::system_error&) {  // no thread: the destructor of `hid` waits for the kernel
  }
}

}  // namespace wrenchd
