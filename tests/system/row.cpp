// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/row.hpp"

#include <array>
#include <chrono>
#include <cstdarg>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <thread>
#include <utility>

#include <pthread.h>
#include <sched.h>

#include "devices/links/hidraw_link.hpp"
#include "devices/links/usb_link.hpp"

namespace wrenchd::test {
namespace {

int rows = 0;
int rows_failed = 0;

const char* name_of(Backend backend) {
  return backend == Backend::hidraw ? "hidraw" : "libusb";
}

}  // namespace

std::string format(const char* format, ...) {
  std::array<char, 512> buffer{};
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
  va_end(arguments);
  return buffer.data();
}

Row::Row(Backend backend, std::string done, std::string specified)
    : backend_(backend), done_(std::move(done)), specified_(std::move(specified)) {}

Row::~Row() {
  if (std::uncaught_exceptions() > 0) failures_.emplace_back("it came to its end");
  ++rows;
  rows_failed += failures_.empty() ? 0 : 1;
  std::printf("%-6s | %-28s | %s | %s | %s\n", name_of(backend_), done_.c_str(), specified_.c_str(),
              seen_.c_str(), failures_.empty() ? "as specified" : "NOT AS SPECIFIED");
  for (const std::string& failure : failures_) std::printf("         not so: %s\n", failure.c_str());
}

bool Row::all_as_specified() {
  std::printf("kernel test: %d of %d as specified\n", rows - rows_failed, rows);
  return rows_failed == 0;
}

UsbDevice await_listed(const UsbIdentity& identity, bool hid) {
  for (int i = 0; i < 500; ++i) {
    for (const UsbDevice& device : list_usb_devices())
      if (device.vendor == identity.vendor && device.product == identity.product &&
          device.serial == identity.serial && device.hidraw_node.empty() == !hid &&
          (!hid || open_error(device, device.hidraw_node).empty()) &&
          open_error(device, device.usb_node).empty())
        return device;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  throw std::runtime_error("the device was plugged in and is not listed");
}

std::unique_ptr<ReportLink> make_link(Backend backend, const UsbDevice& device, int priority,
                                      LinkSettings settings) {
  settings.priority = priority;
  if (backend == Backend::hidraw) return std::make_unique<HidrawLink>(device, settings);
  return std::make_unique<UsbLink>(device, settings);
}

void set_own_priority(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  pthread_setschedparam(pthread_self(), priority > 0 ? SCHED_FIFO : SCHED_OTHER, &parameters);
}

}  // namespace wrenchd::test
