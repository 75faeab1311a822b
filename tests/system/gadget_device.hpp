// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <thread>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "tests/system/usbip_port.hpp"

namespace wrenchd::test {

/// A device as in devices/README.md with the simulated firmware, connected to this machine by Linux's own
/// gadget driver (usb_f_hid) and its virtual host controller (dummy_hcd). Unlike the controller of
/// UsbipPort, this one can be suspended with a device connected, so the machine can sleep.
///
/// The controller transfers once a jiffy (4 ms), and the device sends a report as often.
class GadgetDevice {
 public:
  static constexpr Duration kPeriod = std::chrono::milliseconds(4);

  /// Connects the device. `priority`: SCHED_FIFO, of its thread. Throws std::runtime_error if the kernel has
  /// no gadget driver, or one is in use.
  GadgetDevice(const UsbIdentity& identity, int priority);
  /// Disconnects it.
  ~GadgetDevice();
  GadgetDevice(const GadgetDevice&) = delete;
  GadgetDevice& operator=(const GadgetDevice&) = delete;

  /// Observations of the device.
  struct Record {
    bool motors_on = false;
    WrenchReport last;  ///< last valid command
  };
  Record record() const;

 private:
  void run(const std::stop_token& stop);

  DeviceProfile profile_;
  SimulatedFirmware firmware_;
  Record record_;
  mutable std::mutex mutex_;  ///< protects firmware_ and record_
  int node_ = -1;             ///< the gadget's side of the reports
  std::jthread thread_;
};

}  // namespace wrenchd::test
