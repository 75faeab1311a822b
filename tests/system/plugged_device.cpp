// SPDX-License-Identifier: GPL-3.0-or-later
//
// Connects a device of the reference layout in a simulated hand to this machine's virtual controller
// (vhci_hcd) while this program runs. Usage: plugged_device; SIGTERM disconnects it.

#include <csignal>
#include <cstdio>
#include <exception>

#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tests/system/usbip_emulator.hpp"

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Above the priority of the daemon, because a real device has a processor of its own.
constexpr int kPriority = 60;
constexpr int kPort = 0;

/// A calm hand: it holds the handle over the table of the default scene and lowers it slowly.
SimulationSettings calm_hand() {
  SimulationSettings settings;
  const auto at = [](double time_s, double z_m) {
    Waypoint waypoint;
    waypoint.time_s = time_s;
    waypoint.position_m = {0.0, 0.0, z_m};
    return waypoint;
  };
  settings.hand_path = {at(0.0, 0.065), at(4.0, 0.060), at(8.0, 0.065)};
  settings.hand_repeats = true;
  return settings;
}

}  // namespace

int main() {
  sigset_t end;
  sigemptyset(&end);
  sigaddset(&end, SIGTERM);
  sigaddset(&end, SIGINT);
  sigprocmask(SIG_BLOCK, &end, nullptr);  // the device's thread inherits it
  try {
    SimulatedDevice device(reference_profile(), calm_hand());
    UsbShape shape;
    shape.report_descriptor = reference_descriptor();
    UsbipEmulator plugged(device, {0x1209, 0x0001, "A1"}, shape, kPriority);
    plugged.plug(kPort);
    int signal = 0;
    sigwait(&end, &signal);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plugged_device: %s\n", error.what());
    return 1;
  }
}
