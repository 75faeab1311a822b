// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/discovery/hotplug_monitor.hpp"
#include "tests/devices/usb/mock_device.hpp"

using namespace wrenchd;
using namespace wrenchd::test;

namespace {

class Events {
 public:
  void hear(const PlugEvent& event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(event);
    changed_.notify_all();
  }
  /// Waits for it; a test that never hears of it ends by the time limit of all tests.
  PlugEvent await(PlugEvent::Kind kind, const std::string& subsystem) {
    std::unique_lock lock(mutex_);
    std::vector<PlugEvent>::iterator found;
    changed_.wait(lock, [&] {
      found = std::find_if(events_.begin(), events_.end(),
                           [&](const PlugEvent& e) { return e.kind == kind && e.subsystem == subsystem; });
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
  std::vector<PlugEvent> events_;
};

}  // namespace

TEST_CASE("plugging and unplugging are told, for the node and for the device", "[usb]") {
  const auto source = GENERATE(PlugMonitor::Source::udev, PlugMonitor::Source::kernel);
  MockMachine machine;
  Events events;
  const PlugMonitor monitor([&](const PlugEvent& event) { events.hear(event); }, source);
  MockHidraw device(machine, {.place = "2-1.4", .number = 5});
  const PlugEvent node = events.await(PlugEvent::Kind::plugged, "hidraw");
  CHECK(node.node == "/dev/hidraw5");
  CHECK(node.place == "2-1.4");
  const PlugEvent usb = events.await(PlugEvent::Kind::plugged, "usb");
  CHECK(usb.node == "/dev/bus/usb/002/007");
  CHECK(usb.place == "2-1.4");
  CHECK(events.count() == 2);  // not each interface
  device.unplug();
  CHECK(events.await(PlugEvent::Kind::unplugged, "hidraw").node == "/dev/hidraw5");
  CHECK(events.await(PlugEvent::Kind::unplugged, "usb").place == "2-1.4");
}

TEST_CASE("a monitor ends while nothing happens", "[usb]") {
  const MockMachine machine;
  for (int i = 0; i < 20; ++i) const PlugMonitor monitor([](const PlugEvent&) {});
}
