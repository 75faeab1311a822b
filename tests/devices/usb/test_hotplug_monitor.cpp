// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/discovery/hotplug_monitor.hpp"
#include "tests/devices/usb/mock_device.hpp"

namespace wrenchd::test_hotplug_monitor {

using namespace wrenchd::test;

namespace {

class Events {
 public:
  void record(const HotplugEvent& event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(event);
    changed_.notify_all();
  }
  /// Waits for the event; without it the test ends by its time limit.
  HotplugEvent await(HotplugEvent::Kind kind, const std::string& subsystem) {
    std::unique_lock lock(mutex_);
    std::vector<HotplugEvent>::iterator found;
    changed_.wait(lock, [&] {
      found = std::find_if(events_.begin(), events_.end(),
                           [&](const HotplugEvent& e) { return e.kind == kind && e.subsystem == subsystem; });
      return found != events_.end();
    });
    return *found;
  }
  std::size_t count() {
    const std::lock_guard lock(mutex_);
    return events_.size();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<HotplugEvent> events_;
};

}  // namespace

TEST_CASE("connection and disconnection are reported for the node and for the device", "[usb]") {
  const auto source = GENERATE(HotplugMonitor::Source::udev, HotplugMonitor::Source::kernel);
  MockMachine machine;
  Events events;
  const HotplugMonitor monitor([&](const HotplugEvent& event) { events.record(event); }, source);
  MockHidraw device(machine, {.place = "2-1.4", .number = 5});
  const HotplugEvent node = events.await(HotplugEvent::Kind::connected, "hidraw");
  CHECK(node.node == "/dev/hidraw5");
  CHECK(node.port_path == "2-1.4");
  const HotplugEvent usb = events.await(HotplugEvent::Kind::connected, "usb");
  CHECK(usb.node == "/dev/bus/usb/002/007");
  CHECK(usb.port_path == "2-1.4");
  CHECK(events.count() == 2);  // not one per interface
  device.unplug();
  CHECK(events.await(HotplugEvent::Kind::disconnected, "hidraw").node == "/dev/hidraw5");
  CHECK(events.await(HotplugEvent::Kind::disconnected, "usb").port_path == "2-1.4");
}

TEST_CASE("a monitor can be stopped while no event comes", "[usb]") {
  const MockMachine machine;
  for (int i = 0; i < 20; ++i) const HotplugMonitor monitor([](const HotplugEvent&) {});
}

}  // namespace wrenchd::test_hotplug_monitor
