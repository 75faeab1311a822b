// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <span>
#include <vector>

#include "devices/falcon_start.hpp"
#include "devices/simulation/emulated_device.hpp"
#include "tests/system/usbip_port.hpp"

namespace wrenchd::test {

/// An emulated device that is connected to this machine: the same as behind a LoopbackLink, but with a real
/// kernel between it and the host.
class UsbipEmulator final : public UsbipPort, private ReportSink {
 public:
  /// The device must outlive this. `priority`: SCHED_FIFO, of its thread.
  UsbipEmulator(EmulatedDevice& device, UsbIdentity identity, UsbShape shape, int priority);
  /// The same behind an FTDI serial chip: each IN packet begins with two bytes of modem status. Without data
  /// the chip sends them alone every millisecond. The chip answers vendor requests.
  UsbipEmulator(EmulatedDevice& device, SerialChip& chip, UsbIdentity identity, UsbShape shape, int priority);
  ~UsbipEmulator();

  /// Locks the device for the test; its thread waits.
  template <class F>
  auto with(F&& hand) {
    const std::lock_guard lock(mutex_);
    return hand();
  }
  /// Number of reports that the device accepted, and the bytes of the last one.
  std::uint64_t taken() const;
  std::vector<std::uint8_t> last_taken() const;

 private:
  TimePoint begin(TimePoint now) override;
  TimePoint on_time(TimePoint now) override;
  void on_in() override { flush(); }
  void on_out(Transfer transfer) override;
  bool on_vendor_request(std::uint8_t request, std::uint16_t value) override;
  void on_set_report(std::span<const std::uint8_t> data) override { take(data); }
  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override;
  void take(std::span<const std::uint8_t> report);
  void hear_chip();
  void flush();

  EmulatedDevice& device_;
  SerialChip* chip_ = nullptr;
  std::deque<Bytes> outbox_;
  std::uint64_t taken_ = 0;
  Bytes last_;
};

}  // namespace wrenchd::test
