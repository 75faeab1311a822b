// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/clock.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"
#include "tests/system/usbip_port.hpp"

namespace wrenchd::test {

enum class Backend : std::uint8_t { hidraw, libusb };

[[gnu::format(printf, 1, 2)]] std::string format(const char* format, ...);

inline double us(Duration d) {
  return static_cast<double>(d.count()) / 1e3;
}
inline double ms(Duration d) {
  return static_cast<double>(d.count()) / 1e6;
}

/// One row of the kernel test: action, required result, observation and verdict. The destructor prints it.
class Row {
 public:
  Row(Backend backend, std::string done, std::string specified);
  ~Row();
  Row(const Row&) = delete;
  Row& operator=(const Row&) = delete;

  void saw(const std::string& what) { seen_ += (seen_.empty() ? "" : "; ") + what; }
  void check(bool holds, const char* what) {
    if (!holds) failures_.emplace_back(what);
  }
  /// Prints the number of rows. Returns true if all of them passed.
  static bool all_as_specified();

 private:
  Backend backend_;
  std::string done_, specified_, seen_;
  std::vector<std::string> failures_;
};

#define CHECK_THAT(row, condition) (row).check(condition, #condition)

/// Waits until the device is listed with its nodes and can be opened, and returns it. Throws if it does not
/// appear. `hid`: it has a hidraw node.
UsbDevice await_listed(const UsbIdentity& identity, bool hid = true);

std::unique_ptr<ReportLink> make_link(Backend backend, const UsbDevice& device, int priority,
                                      LinkSettings settings = {});

/// Sets the SCHED_FIFO priority of this thread; 0: ordinary scheduling.
void set_own_priority(int priority);

}  // namespace wrenchd::test
