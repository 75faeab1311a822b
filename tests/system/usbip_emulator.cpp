// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/usbip_emulator.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace wrenchd::test {
namespace {

/// Clear to send, data set ready, transmitter empty.
constexpr std::array<std::uint8_t, 2> kModemStatus = {0x31, 0x60};

}  // namespace

UsbipEmulator::UsbipEmulator(EmulatedDevice& device, UsbIdentity identity, UsbShape shape, int priority)
    : UsbipPort(std::move(identity), std::move(shape), priority), device_(device) {}

UsbipEmulator::UsbipEmulator(EmulatedDevice& device, SerialChip& chip, UsbIdentity identity, UsbShape shape,
                             int priority)
    : UsbipEmulator(device, std::move(identity), std::move(shape), priority) {
  chip_ = &chip;
}

UsbipEmulator::~UsbipEmulator() {
  unplug();
}

std::uint64_t UsbipEmulator::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

std::vector<std::uint8_t> UsbipEmulator::last_taken() const {
  const std::lock_guard lock(mutex_);
  return last_;
}

TimePoint UsbipEmulator::begin(TimePoint now) {
  return on_time(now);
}

TimePoint UsbipEmulator::on_time(TimePoint now) {
  device_.advance_to(now, *this);
  if (chip_ != nullptr && outbox_.empty() && !in_.empty()) {
    outbox_.emplace_back(kModemStatus.begin(), kModemStatus.end());
    flush();
  }
  return device_.next_event();
}

void UsbipEmulator::on_out(Transfer transfer) {
  reply(transfer.number, 0, transfer.length, {});
  take(transfer.data);
}

void UsbipEmulator::take(std::span<const std::uint8_t> report) {
  const TimePoint now = std::chrono::steady_clock::now();
  device_.advance_to(now, *this);
  if (!device_.take_command(now, report)) {
    if (chip_ == nullptr) return;
    chip_->write(report);
    return hear_chip();
  }
  ++taken_;
  last_.assign(report.begin(), report.end());
}

void UsbipEmulator::take_report(TimePoint, std::span<const std::uint8_t> report) noexcept {
  Bytes packet;
  if (chip_ != nullptr) packet.assign(kModemStatus.begin(), kModemStatus.end());
  packet.insert(packet.end(), report.begin(), report.end());
  outbox_.push_back(std::move(packet));
  flush();
}

bool UsbipEmulator::on_vendor_request(std::uint8_t request, std::uint16_t value) {
  if (chip_ == nullptr) return false;
  chip_->control(request, value);
  if (request == kFtdiReset) outbox_.clear();
  return true;
}

/// Returns the next packet of the serial chip.
void UsbipEmulator::hear_chip() {
  constexpr std::size_t kPacket = 62;
  for (Bytes bytes = chip_->read(kPacket); !bytes.empty(); bytes = chip_->read(kPacket))
    take_report({}, bytes);
}

void UsbipEmulator::flush() {
  for (; !in_.empty() && !outbox_.empty(); in_.pop_front(), outbox_.pop_front()) {
    const Bytes& report = outbox_.front();
    const auto length = std::min<std::size_t>(report.size(), in_.front().length);
    reply(in_.front().number, 0, static_cast<std::uint32_t>(length), std::span(report).first(length));
  }
}

}  // namespace wrenchd::test
