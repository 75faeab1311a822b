// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wrenchd {

/// Contract of an FTDI serial chip, as far as a Falcon needs it. control() is a vendor request to the device
/// (type 0x40, index 0). write() and read() use the bulk endpoints; read() removes the two bytes of modem
/// status before each packet. Not RT-safe: every function may wait and throw.
class SerialChip {
 public:
  virtual ~SerialChip() = default;
  virtual void control(std::uint8_t request, std::uint16_t value) = 0;
  virtual void write(std::span<const std::uint8_t> bytes) = 0;
  /// Returns the bytes received, at most `most`. Returns an empty vector if nothing arrives within one
  /// second.
  virtual std::vector<std::uint8_t> read(std::size_t most) = 0;
};

/// Starts a Falcon after power-on: handshake with its boot loader, the firmware in blocks that the loader
/// echoes, then the packet baud rate. Loading sometimes fails on real devices, so falcon_start() tries up to
/// `tries` times. Throws std::runtime_error with the reason and the remedy. Not RT-safe: may take seconds.
/// Source: github.com/libnifalcon/libnifalcon, FalconComm.h, FalconCommLibUSB.cpp, FalconFirmware.cpp.
void falcon_start(SerialChip& chip, std::span<const std::uint8_t> firmware, int tries = 10);

/// Sets the packet baud rate, for a Falcon with a loaded firmware. Not RT-safe: waits for USB transfers.
void falcon_resume(SerialChip& chip);

/// Returns true if a firmware runs: it answers a packet of zeros, which keeps the motors at zero. Not
/// RT-safe: may take a second.
bool falcon_answers(SerialChip& chip);

/// Brings a Falcon from any state to packet exchange. If it answers at the packet baud rate, leaves its state
/// unchanged; otherwise starts it with the firmware in the file. Throws std::runtime_error, also if a
/// firmware is needed and no file is named. Not RT-safe: reads a file, may take seconds.
void falcon_open(SerialChip& chip, const std::string& firmware_file);

// What the driver sends to the boot loader, and the answer, for drivers and emulators.
inline constexpr std::array<std::uint8_t, 3> kFalconHandshake = {0x0a, 0x43, 0x0d};
inline constexpr std::array<std::uint8_t, 4> kFalconHandshakeReply = {0x0a, 0x44, 0x2c, 0x0d};

// Vendor requests of the FTDI chip and their values, for drivers and emulators.
inline constexpr std::uint8_t kFtdiReset = 0;
inline constexpr std::uint8_t kFtdiModemControl = 1;
inline constexpr std::uint8_t kFtdiFlowControl = 2;
inline constexpr std::uint8_t kFtdiBaudRate = 3;
inline constexpr std::uint8_t kFtdiDataFormat = 4;
inline constexpr std::uint8_t kFtdiLatency = 9;
inline constexpr std::uint16_t kFtdiPurgeIn = 1;
inline constexpr std::uint16_t kFtdiPurgeOut = 2;
inline constexpr std::uint16_t kFtdiDtrLow = 0x0100;
inline constexpr std::uint16_t kFtdiDtrHigh = 0x0101;
inline constexpr std::uint16_t kFtdiRtsLow = 0x0200;
inline constexpr std::uint16_t kFtdi8N1 = 8;
inline constexpr std::uint16_t kFtdi9600Baud = 0x4138;
inline constexpr std::uint16_t kFtdiLoaderSpeed = 0x15;  ///< 140 kBd
inline constexpr std::uint16_t kFtdiPacketSpeed = 0x02;

}  // namespace wrenchd
