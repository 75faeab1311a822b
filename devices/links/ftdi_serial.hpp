// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "devices/falcon_start.hpp"

struct libusb_device_handle;

namespace wrenchd {

/// FTDI serial chip with one port, over libusb: vendor requests of type 0x40 to the device, two bulk
/// endpoints, and two bytes of modem status at the start of each IN packet, which read() removes. The
/// interface must be claimed, and no other thread may read. Not RT-safe: each call may take a second, and
/// throws std::runtime_error on failure. Sources: libftdi (ftdi.h, ftdi.c), and drivers/usb/serial/ftdi_sio.h
/// of Linux.
class FtdiSerial final : public SerialChip {
 public:
  static constexpr std::size_t kStatusBytes = 2;

  /// `packet_bytes`: wMaxPacketSize of the IN endpoint.
  FtdiSerial(libusb_device_handle* handle, std::uint8_t in, std::uint8_t out, std::size_t packet_bytes)
      : handle_(handle), in_(in), out_(out), packet_(packet_bytes) {}

  void control(std::uint8_t request, std::uint16_t value) override;
  void write(std::span<const std::uint8_t> bytes) override;
  std::vector<std::uint8_t> read(std::size_t most) override;

 private:
  libusb_device_handle* handle_;
  std::uint8_t in_, out_;
  std::vector<std::uint8_t> packet_;    ///< buffer of one USB packet
  std::vector<std::uint8_t> buffered_;  ///< received bytes that have not been read yet
};

}  // namespace wrenchd
