// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/gadget_device.hpp"

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "devices/simulation/reference_profile.hpp"
#include "tests/support/ideal_encoders.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tests/system/kernel_attribute.hpp"
#include "tests/system/row.hpp"

namespace wrenchd::test {
namespace {

using SteadyClock = std::chrono::steady_clock;
namespace fs = std::filesystem;

const fs::path kGadget = "/sys/kernel/config/usb_gadget/wrenchd";
const fs::path kFunction = kGadget / "functions/hid.usb0";
constexpr std::size_t kLongestReport = 64;

/// Describes the device to the kernel, which then offers `/dev/hidg0`.
void define_gadget(const UsbIdentity& identity) {
  fs::create_directory(kGadget);
  write_attribute(kGadget / "idVendor", identity.vendor);
  write_attribute(kGadget / "idProduct", identity.product);
  fs::create_directory(kGadget / "strings/0x409");
  write_attribute(kGadget / "strings/0x409/serialnumber", identity.serial);
  fs::create_directory(kGadget / "configs/c.1");
  fs::create_directory(kFunction);
  write_attribute(kFunction / "report_length", kLongestReport);
  const Bytes descriptor = reference_descriptor();
  write_attribute(kFunction / "report_desc", std::string(descriptor.begin(), descriptor.end()));
  fs::create_directory_symlink(kFunction, kGadget / "configs/c.1/hid.usb0");
}

}  // namespace

GadgetDevice::GadgetDevice(const UsbIdentity& identity, int priority)
    : profile_(reference_profile()), firmware_(profile_, ideal_encoders(), kPeriod) {
  if (std::system("modprobe -a libcomposite usb_f_hid dummy_hcd") != 0)
    throw std::runtime_error("the kernel has no gadget driver");
  define_gadget(identity);
  write_attribute(kGadget / "UDC", "dummy_udc.0");
  for (int i = 0; i < 500 && node_ < 0; ++i) {
    node_ = ::open("/dev/hidg0", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (node_ < 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (node_ < 0) throw std::runtime_error("the gadget driver offers no /dev/hidg0");
  thread_ = std::jthread([this, priority](const std::stop_token& stop) {
    set_own_priority(priority);
    run(stop);
  });
}

GadgetDevice::~GadgetDevice() {
  thread_.request_stop();
  thread_.join();
  ::close(node_);
  std::error_code ignored;
  std::ofstream(kGadget / "UDC") << "\n" << std::flush;
  for (const fs::path& part : {kGadget / "configs/c.1/hid.usb0", kFunction, kGadget / "configs/c.1",
                               kGadget / "strings/0x409", kGadget})
    fs::remove(part, ignored);
}

GadgetDevice::Record GadgetDevice::record() const {
  const std::lock_guard lock(mutex_);
  Record record = record_;
  record.motors_on = firmware_.motors_on();
  return record;
}

void GadgetDevice::run(const std::stop_token& stop) {
  const TimePoint powered = SteadyClock::now();
  std::vector<std::uint8_t> out(profile_.pose_report.length);
  std::array<std::uint8_t, kLongestReport> in{};
  for (TimePoint next = powered; !stop.stop_requested(); next += kPeriod) {
    std::this_thread::sleep_until(next);
    const TimePoint now = SteadyClock::now();
    const std::lock_guard lock(mutex_);
    for (ssize_t n = 0; (n = ::read(node_, in.data(), in.size())) > 0;) {
      const auto bytes = std::span(in).first(static_cast<std::size_t>(n));
      const auto [outcome, report] = decode(profile_.wrench_report, bytes);
      if (outcome == Decoding::ok) record_.last = report;
      firmware_.take_command(now, bytes);
    }
    firmware_.motor_wrench(now);  // the watchdog
    PoseReport report = firmware_.make_report(now - powered);
    report.X_BH = {};
    encode(profile_.pose_report, report, out);
    // The driver refuses a report while the previous one waits: that one is lost, as on a real bus.
    [[maybe_unused]] const ssize_t sent = ::write(node_, out.data(), out.size());
  }
}

}  // namespace wrenchd::test
