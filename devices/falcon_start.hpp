// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wrenchd {

/// An FTDI serial chip, as far as a Falcon needs it. A transport that reaches the device implements it:
/// control() is a vendor request to the device (type 0x40, index 0), write() and read() are the bulk
/// endpoints, and the two bytes of modem status before each packet are taken off. All of them may wait and
/// throw. Not RT safe.
class SerialChip {
 public:
  virtual ~SerialChip() = default;
  virtual void control(std::uint8_t request, std::uint16_t value) = 0;
  virtual void write(std::span<const std::uint8_t> bytes) = 0;
  /// What has arrived, at most so many bytes; empty after a second of nothing.
  virtual std::vector<std::uint8_t> read(std::size_t most) = 0;
};

/// Brings a Falcon from power-on to where it exchanges packets: handshake with its loader, the firmware in
/// blocks that it echoes, then the speed at which the firmware talks. Loading fails now and then on real
/// devices, so it is tried `tries` times. Throws std::runtime_error that says what failed and what to do. Not
/// RT safe. Facts: github.com/libnifalcon/libnifalcon, FalconComm.h, FalconCommLibUSB.cpp,
/// FalconFirmware.cpp.
void falcon_start(SerialChip& chip, std::span<const std::uint8_t> firmware, int tries = 10);

/// Only the speed: for a Falcon whose firmware is loaded already.
void falcon_resume(SerialChip& chip);

/// Whether a firmware runs and answers: a packet of zeros brings one back. Motors stay at zero.
bool falcon_answers(SerialChip& chip);

/// Brings a Falcon to where it exchanges packets, whatever state it is in: one that answers at the firmware's
/// speed is left as it is, any other is started with the firmware in that file. Throws std::runtime_error,
/// also where a firmware is needed and no file is named.
void falcon_open(SerialChip& chip, const std::string& firmware_file);

// What the FTDI chip is asked for, and with which values. For it and for what stands in for it.
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
