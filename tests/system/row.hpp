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

/// One line of the kernel test's table: what is done, what must come of it, what was seen, and whether that
/// is the same. It is printed where the row ends.
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
  /// Of all rows so far; prints how many.
  static bool all_as_specified();

 private:
  Backend backend_;
  std::string done_, specified_, seen_;
  std::vector<std::string> failures_;
};

#define CHECK_THAT(row, condition) (row).check(condition, #condition)

/// The device in the list of what is plugged in, with the nodes that are there for it, once it may be opened.
/// Throws where it does not come. `hid`: it has a hidraw node.
UsbDevice await_listed(const UsbIdentity& identity, bool hid = true);

std::unique_ptr<ReportLink> make_link(Backend backend, const UsbDevice& device, int priority,
                                      LinkSettings settings = {});

/// SCHED_FIFO of this thread; 0: an ordinary one.
void set_own_priority(int priority);

}  // namespace wrenchd::test
