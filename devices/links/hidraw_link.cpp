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
#include <utility>

#include <fcntl.h>
#include <hidapi/hidapi.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>

#include "devices/links/wake_up.hpp"

namespace wrenchd {
namespace {

/// hidapi is not made for several threads where it opens and closes: its error text is one for all.
std::mutex& hidapi_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::set<int> open_files() {
  std::set<int> files;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    files.insert(std::atoi(entry.path().filename().c_str()));
  std::erase_if(files, [](int file) { return fcntl(file, F_GETFD) < 0; });  // the directory's own
  return files;
}

/// The file descriptor that hidapi opened on the node and keeps to itself: one that was not there before and
/// is the node. -1 where there is none.
int file_opened(const std::string& node, const std::set<int>& before) {
  struct stat wanted {};
  if (stat(node.c_str(), &wanted) != 0) return -1;
  for (const int file : open_files()) {
    struct stat found {};
    if (before.count(file) == 0 && fstat(file, &found) == 0 && found.st_dev == wanted.st_dev &&
        found.st_ino == wanted.st_ino)
      return file;
  }
  return -1;
}

/// Refuses where another device than the wanted one is behind the node now. To be asked while the node is
/// open: the kernel gives its number to no other device until it is closed.
void check_identity(const UsbDevice& wanted) {
  for (const UsbDevice& found : list_usb_devices()) {
    if (found.hidraw_node != wanted.hidraw_node) continue;
    if (found.is_same_device(wanted)) return;
    throw std::runtime_error(wanted.hidraw_node + " is " + describe(found) + ", not " + describe(wanted) +
                             ": nothing was written to it; look for the device anew");
  }
  throw std::runtime_error(open_error(wanted, wanted.hidraw_node, ENODEV));
}

}  // namespace

void HidrawLink::CloseHid::operator()(hid_device_* device) const noexcept {
  const std::lock_guard lock(hidapi_mutex());
  hid_close(device);
}

HidrawLink::HidrawLink(UsbDevice device, LinkSettings settings)
    : device_(std::move(device)), settings_(std::move(settings)) {}

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
  // One for each thread: hidapi keeps an error text with each, which reader and writer would race for.
  Hid writing;
  {
    std::unique_lock lock(hidapi_mutex());
    Hid reading;
    try {
      const std::set<int> before = open_files();
      reading = open_node();
      fd_ = file_opened(node, before);
      writing = open_node();
    } catch (...) {
      lock.unlock();  // closing takes it
      throw;
    }
    reader_ = std::move(reading);
  }
  if (fd_ < 0) {
    reader_.reset();
    throw std::runtime_error("cannot find the file that hidapi opened for " + node + "; is /proc mounted?");
  }
  // The kernel lets any number of programs write to a HID device; two hosts on one hand must not be.
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
  // hidapi polls, too, but makes a text on the heap of what it finds wrong, and after unplugging the kernel
  // still gives out what waited.
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

/// On the writer's thread.
LinkStatus HidrawLink::write_blocking(hid_device_* hid, bool numbered, std::span<const std::uint8_t> report) {
  std::array<std::uint8_t, kMaxReportBytes + 1> framed{};
  const std::size_t head = numbered ? 0 : 1;
  std::copy(report.begin(), report.end(), framed.begin() + static_cast<std::ptrdiff_t>(head));
  errno = 0;
  if (hid_write(hid, framed.data(), head + report.size()) >= 0) return LinkStatus::ok;
  return errno == ENODEV || errno == EIO ? LinkStatus::disconnected : LinkStatus::not_ready;
}

void HidrawLink::wait_readable(TimePoint deadline) noexcept {
  if (reader_ && !disconnected_) wait_for_fd(fd_, POLLIN, deadline);
}

void HidrawLink::close() noexcept {
  writer_.reset();
  reader_.reset();
  fd_ = -1;
}

}  // namespace wrenchd
