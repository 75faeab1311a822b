// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/ftdi_serial.hpp"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>

#include <libusb-1.0/libusb.h>

namespace wrenchd {
namespace {

constexpr unsigned kTimeout_ms = 1000;
constexpr std::chrono::milliseconds kTimeout{kTimeout_ms};
constexpr std::uint8_t kVendorRequest = 0x40;

void check_result(const char* doing, int error) {
  if (error >= 0) return;
  throw std::runtime_error(std::string("serial chip: ") + doing + ": " + libusb_strerror(error) +
                           "; unplug the device and connect it again");
}

}  // namespace

void FtdiSerial::control(std::uint8_t request, std::uint16_t value) {
  check_result("request",
               libusb_control_transfer(handle_, kVendorRequest, request, value, 0, nullptr, 0, kTimeout_ms));
  if (request == kFtdiReset && value != kFtdiPurgeOut) buffered_.clear();
}

void FtdiSerial::write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    int written = 0;
    // libusb does not change the buffer of an OUT transfer.
    check_result("write", libusb_bulk_transfer(handle_, out_, const_cast<unsigned char*>(bytes.data()),
                                               static_cast<int>(bytes.size()), &written, kTimeout_ms));
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

/// Without data, the chip sends its status alone, once per latency period.
std::vector<std::uint8_t> FtdiSerial::read(std::size_t most) {
  const auto until = std::chrono::steady_clock::now() + kTimeout;
  while (buffered_.empty() && std::chrono::steady_clock::now() < until) {
    int n = 0;
    const int error =
        libusb_bulk_transfer(handle_, in_, packet_.data(), static_cast<int>(packet_.size()), &n, kTimeout_ms);
    if (error != LIBUSB_ERROR_TIMEOUT) check_result("read", error);
    if (n > static_cast<int>(kStatusBytes))
      buffered_.insert(buffered_.end(), packet_.begin() + kStatusBytes, packet_.begin() + n);
  }
  const auto count = static_cast<std::ptrdiff_t>(std::min(most, buffered_.size()));
  std::vector<std::uint8_t> bytes(buffered_.begin(), buffered_.begin() + count);
  buffered_.erase(buffered_.begin(), buffered_.begin() + count);
  return bytes;
}

}  // namespace wrenchd
