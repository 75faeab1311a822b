// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/power_saving.hpp"

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "core/fault.hpp"
#include "daemon/servo/pace_watch.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/system/gadget_device.hpp"
#include "tests/system/kernel_attribute.hpp"
#include "tests/system/usbip_device.hpp"

namespace wrenchd::test {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr int kPriority = 60;  ///< as in kernel_test.cpp
constexpr int kPort = 0;

/// An open device, and a loop of one tick per report that releases the hand at every fault, those of the
/// times of its ticks included. It arms only on request.
class Loop {
 public:
  Loop(Backend backend, const UsbDevice& listed, Duration period)
      : link_(make_link(backend, listed, kPriority)),
        device_(reference_profile(), *link_),
        period_(period),
        pace_(period, 50ms) {
    device_.open();
  }
  ~Loop() { device_.close(); }
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  void arm() { armed_ = true; }
  bool armed() const { return armed_; }

  /// Observations of a run.
  struct Observed {
    int fresh = 0;
    Fault link = Fault::none;  ///< first fault of the device
    FaultSet times = 0;        ///< faults of the times of ticks
    TimePoint first_fresh{};   ///< time of the first fresh sample
    bool lost() const { return link == Fault::device_lost; }
  };
  /// Ends early if the device is lost.
  Observed run_for(Duration d) {
    set_own_priority(kPriority);
    Observed seen;
    const TimePoint began = SteadyClock::now();
    while (!seen.lost() && SteadyClock::now() < began + d) {
      device_.wait_readable(SteadyClock::now() + 2 * period_);
      const TimePoint now = SteadyClock::now();
      const FaultSet times = pace_.check(now, clock_.time_suspended());
      const DeviceSample sample = device_.read_newest(now);
      armed_ = armed_ && times == 0 && sample.fault == Fault::none;
      Fault fault = sample.fault;
      if (fault == Fault::none) fault = device_.write(now, {}, armed_);
      if (fault != Fault::none) {
        device_.release(now);
        armed_ = false;
      }
      seen.times |= times;
      if (seen.link == Fault::none) seen.link = fault;
      if (sample.fresh && seen.fresh++ == 0) seen.first_fresh = now;
    }
    set_own_priority(0);
    return seen;
  }

 private:
  std::unique_ptr<ReportLink> link_;
  ProfileDevice device_;
  Duration period_;
  PaceWatch pace_;
  WallClock clock_;
  bool armed_ = false;
};

/// As a laptop or a program like TLP sets it: devices that nobody uses are suspended at once.
void autosuspend(Backend backend) {
  Row row(backend, "autosuspend without a delay",
          "suspended while closed; opening resumes it, the first sample within 0.5 s; it stays active "
          "while it is open, even if it sends nothing for 200 ms; suspended again after closing");
  const UsbIdentity identity;
  UsbipDevice far(identity, 1000.0, kPriority);
  far.plug(kPort);
  const UsbDevice listed = await_listed(identity);
  const fs::path power = fs::path("/sys/bus/usb/devices") / listed.port_path / "power";
  write_attribute(power / "autosuspend_delay_ms", "0");
  write_attribute(power / "control", "auto");
  const auto await = [&](const std::string& status) {
    for (int i = 0; i < 300 && read_attribute(power / "runtime_status") != status; ++i)
      std::this_thread::sleep_for(10ms);
    return read_attribute(power / "runtime_status") == status;
  };
  CHECK_THAT(row, await("suspended"));
  {
    const TimePoint closed_until = SteadyClock::now();
    Loop loop(backend, listed, 1ms);
    const Loop::Observed opened = loop.run_for(500ms);
    row.saw(format("first sample after %.1f ms", ms(opened.first_fresh - closed_until)));
    CHECK_THAT(row, opened.fresh > 100 && opened.first_fresh - closed_until < 500ms);
    loop.arm();
    const Loop::Observed armed = loop.run_for(100ms);
    CHECK_THAT(row, armed.link == Fault::none && armed.fresh >= 99 && far.record().motors_on);
    far.set(Trouble::silent);
    const Loop::Observed silent = loop.run_for(200ms);
    CHECK_THAT(row, silent.link == Fault::sample_stale && !far.record().motors_on);
    CHECK_THAT(row, read_attribute(power / "runtime_status") == "active");
    far.set(Trouble::none);
    loop.run_for(5ms);
    const Loop::Observed after = loop.run_for(50ms);
    CHECK_THAT(row, after.link == Fault::none && after.fresh >= 49 && !loop.armed());
  }
  CHECK_THAT(row, await("suspended"));
}

/// Puts the machine to sleep as far as a virtual machine can: processes are frozen, devices and clocks
/// suspended, and two seconds later all of it is resumed. Only the firmware, which would switch the
/// processor off, is left out ("core" in Documentation/power/basic-pm-debugging.rst of Linux).
void sleep_for_two_seconds() {
  write_attribute("/sys/module/suspend/parameters/pm_test_delay", "2");
  write_attribute("/sys/power/pm_test", "core");
  write_attribute("/sys/power/state", "mem");
}

void machine_sleeps(Backend backend) {
  Row row(
      backend, "the machine sleeps, armed",
      format("the first tick afterwards is one of %s, and releases the hand; %s; motors off until armed",
             fault_row(Fault::suspended).name.data(),
             backend == Backend::hidraw ? "reports are read again" : "device_lost, found and opened again"));
  const UsbIdentity identity;
  GadgetDevice far(identity, kPriority);
  const UsbDevice listed = await_listed(identity);
  auto loop = std::make_unique<Loop>(backend, listed, GadgetDevice::kPeriod);
  loop->run_for(100ms);
  loop->arm();
  const Loop::Observed before = loop->run_for(100ms);
  const GadgetDevice::Record awake = far.record();

  std::thread sleeper([] {
    std::this_thread::sleep_for(50ms);
    sleep_for_two_seconds();
  });
  const Loop::Observed during = loop->run_for(500ms);
  sleeper.join();
  const GadgetDevice::Record woken = far.record();
  if (during.lost()) {
    loop.reset();
    const UsbDevice found = await_listed(identity);
    CHECK_THAT(row, found.is_same_device(listed) && found.port_path == listed.port_path);
    loop = std::make_unique<Loop>(backend, found, GadgetDevice::kPeriod);
  }
  loop->run_for(100ms);
  const Loop::Observed disarmed = loop->run_for(100ms);
  const GadgetDevice::Record quiet = far.record();
  loop->arm();
  const Loop::Observed again = loop->run_for(100ms);
  row.saw(format("asleep for %.3f s; %s; %d samples, then disarmed %d, armed %d",
                 seconds(WallClock().time_suspended()), fault_row(during.link).name.data(), during.fresh,
                 disarmed.fresh, again.fresh));
  CHECK_THAT(row, before.link == Fault::none && before.fresh >= 24 && awake.motors_on && awake.last.enable);
  CHECK_THAT(row, (during.times & bit(Fault::suspended)) != 0);
  CHECK_THAT(row, during.lost() == (backend == Backend::libusb));
  CHECK_THAT(row, !woken.motors_on);
  CHECK_THAT(row, disarmed.link == Fault::none && disarmed.times == 0 && disarmed.fresh >= 24);
  CHECK_THAT(row, !quiet.motors_on && !quiet.last.enable);
  CHECK_THAT(row, again.link == Fault::none && far.record().motors_on);
}

}  // namespace

void power_saving(Backend backend) {
  autosuspend(backend);
  machine_sleeps(backend);
}

}  // namespace wrenchd::test
