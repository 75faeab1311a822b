// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/falcon_start.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "core/files/opened_file.hpp"

namespace wrenchd {
namespace {

constexpr std::array<std::uint8_t, 1> kReady = {0x41};
constexpr int kMaxHandshakes = 100;
constexpr std::size_t kBlock = 128;

/// With a shorter latency timer the answers of the boot loader to the handshake are lost.
constexpr std::uint16_t kLoaderLatency_ms = 16;
constexpr std::uint16_t kPacketLatency_ms = 1;

void purge(SerialChip& chip) {
  chip.control(kFtdiReset, kFtdiPurgeIn);
  chip.control(kFtdiReset, kFtdiPurgeOut);
}

/// Reads until `wanted` bytes have arrived, or no more bytes arrive.
std::vector<std::uint8_t> read_all(SerialChip& chip, std::size_t wanted) {
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < wanted) {
    const std::vector<std::uint8_t> more = chip.read(wanted - bytes.size());
    if (more.empty()) break;
    bytes.insert(bytes.end(), more.begin(), more.end());
  }
  return bytes;
}

bool perform_handshake(SerialChip& chip) {
  for (int i = 0; i < kMaxHandshakes; ++i) {
    chip.write(kFalconHandshake);
    const auto answer = read_all(chip, kFalconHandshakeReply.size());
    if (std::equal(answer.begin(), answer.end(), kFalconHandshakeReply.begin(), kFalconHandshakeReply.end()))
      return true;
  }
  return false;
}

/// Returns the reason of a failure; empty on success.
std::string try_to_load(SerialChip& chip, std::span<const std::uint8_t> firmware) {
  purge(chip);
  chip.control(kFtdiLatency, kLoaderLatency_ms);
  chip.control(kFtdiBaudRate, kFtdi9600Baud);
  chip.control(kFtdiDataFormat, kFtdi8N1);
  chip.control(kFtdiFlowControl, 0);
  chip.control(kFtdiModemControl, kFtdiRtsLow);
  chip.control(kFtdiModemControl, kFtdiDtrLow);
  chip.control(kFtdiModemControl, kFtdiDtrHigh);
  if (!perform_handshake(chip)) return "its boot loader does not answer";
  chip.control(kFtdiModemControl, kFtdiDtrLow);
  chip.control(kFtdiBaudRate, kFtdiLoaderSpeed);
  chip.write(kReady);
  const auto ready = read_all(chip, kReady.size());
  if (!std::equal(ready.begin(), ready.end(), kReady.begin(), kReady.end()))
    return "its boot loader is not ready for the firmware";
  for (std::size_t at = 0; at < firmware.size(); at += kBlock) {
    const auto block = firmware.subspan(at, std::min(kBlock, firmware.size() - at));
    chip.write(block);
    const auto echo = read_all(chip, block.size());
    if (!std::equal(echo.begin(), echo.end(), block.begin(), block.end()))
      return "byte " + std::to_string(at) + " and later of the firmware were echoed wrongly";
  }
  return {};
}

}  // namespace

void falcon_resume(SerialChip& chip) {
  chip.control(kFtdiLatency, kPacketLatency_ms);
  chip.control(kFtdiBaudRate, kFtdiPacketSpeed);
  purge(chip);
}

void falcon_start(SerialChip& chip, std::span<const std::uint8_t> firmware, int tries) {
  if (firmware.empty())
    throw std::runtime_error("Falcon: the firmware is empty; set the file of the manufacturer's SDK");
  std::string problem;
  for (int i = 0; i < tries; ++i) {
    problem = try_to_load(chip, firmware);
    if (problem.empty()) return falcon_resume(chip);
  }
  throw std::runtime_error("Falcon: the firmware could not be loaded in " + std::to_string(tries) +
                           " attempts: " + problem + "; disconnect power and cable, and try again");
}

bool falcon_answers(SerialChip& chip) {
  // Zero efforts with homing mode on; without homing mode a Falcon loses its homing.
  constexpr std::array<std::uint8_t, 16> kZeros = {'<', 'A', 'A', 'A', 'A', 'A', 'A', 'A',
                                                   'A', 'A', 'A', 'A', 'A', 'B', 'A', '>'};
  falcon_resume(chip);
  chip.write(kZeros);
  const auto answer = read_all(chip, kZeros.size());
  return answer.size() == kZeros.size() && answer.front() == '<' && answer.back() == '>';
}

void falcon_open(SerialChip& chip, const std::string& firmware_file) {
  if (falcon_answers(chip)) return;
  if (firmware_file.empty())
    throw std::runtime_error(
        "Falcon: it runs no firmware, and none is named; write a profile that inherits falcon, with the file "
        "of "
        "the manufacturer's SDK as firmware in [endpoints]");
  constexpr std::uint64_t kMaxFirmwareBytes = std::uint64_t{1} << 24;
  const std::string bytes = read_file_if_readable(firmware_file, kMaxFirmwareBytes).value_or("");
  if (bytes.empty())
    throw std::runtime_error("Falcon: cannot read the firmware " + firmware_file +
                             "; set the file of the manufacturer's SDK");
  falcon_start(chip, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

}  // namespace wrenchd
