// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/calibrate.hpp"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <stdexcept>

#include <poll.h>
#include <unistd.h>

#include "config/calibration_store.hpp"
#include "config/known_profiles.hpp"
#include "config/load_profile.hpp"
#include "config/settings.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/device_homing.hpp"
#include "devices/links/reconnecting_link.hpp"

namespace wrenchd {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(1);

std::atomic<bool> interrupted{false};

std::vector<DeviceProfile> profiles_named(const std::string& name) {
  if (name == kAnyProfile) return known_profiles(SearchPath()).profiles;
  const DeviceProfile profile = load_profile_named(name);
  if (profile.transport == Transport::loopback)
    throw std::runtime_error("profile " + profile.name +
                             ": it is for the simulated device, which needs no calibration");
  return {profile};
}

/// Profile and serial number of the connected device to calibrate.
struct Target {
  DeviceProfile profile;
  std::string serial;
};

Target find_target(const CalibrateOptions& options) {
  const std::vector<DeviceProfile> profiles = profiles_named(options.profile);
  const std::vector<UsbDevice> plugged = list_usb_devices();
  DeviceCriteria wanted;
  wanted.serial = options.serial;
  if (options.profile != kAnyProfile) wanted.profile = profiles.front().name;
  const DeviceChoice choice = choose_device(plugged, profiles, wanted);
  if (!choice.selection) {
    std::string text = "no such device is plugged in; wrenchctl devices lists what is";
    for (const std::string& seen : describe_rejected(plugged, choice)) text += "\n  " + seen;
    throw std::runtime_error(text);
  }
  const UsbDevice& device = plugged[choice.selection->device];
  if (device.serial.empty())
    throw std::runtime_error(
        describe(device) +
        ": it has no serial number, so nothing can be kept for it and no other; have its "
        "firmware send one");
  return {profiles[choice.selection->profile], device.serial};
}

/// Returns true if the operator has typed a line since the last call.
bool line_typed() {
  pollfd input = {STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, 0) <= 0 || (input.revents & POLLIN) == 0) return false;
  char c = 0;
  while (read(STDIN_FILENO, &c, 1) == 1)
    if (c == '\n') return true;
  return false;
}

}  // namespace

Calibration calibrate(ProfileDevice& device, const DeviceProfile& profile, const std::string& serial,
                      Clock& clock, const OperatorInterface& person) {
  DeviceHoming homing(device, profile, DeviceHoming::Extent::full);
  std::string said;
  while (!person.cancelled()) {
    clock.sleep_until(clock.now() + kPeriod);
    if (homing.state().step == HomingStep::reference && person.confirmed()) homing.confirm();
    const HomingState& state = homing.step(clock.now());
    if (homing.device_lost())
      throw std::runtime_error("the device was unplugged; plug it in, and begin again");
    const std::string words = operator_instruction(state);
    if (state.step == HomingStep::failed) throw std::runtime_error(words);
    if (words != said) person.instruct(words);
    said = words;
    if (state.step == HomingStep::done) return {profile.name, serial, homing.offsets()};
  }
  throw std::runtime_error("stopped; nothing was stored");
}

int run_calibrate(const CalibrateOptions& options) {
  const Target target = find_target(options);
  const CalibrationStore store;
  ReconnectingLink link(target.profile, target.serial, link_settings(target.profile));
  ProfileDevice device(target.profile, link);
  WallClock clock;
  device.open();
  std::signal(SIGINT, [](int) { interrupted.store(true); });
  std::printf("%s, serial number %s. Its motors stay off. Ctrl-C ends.\n", target.profile.name.c_str(),
              target.serial.c_str());
  const OperatorInterface person = {[](const std::string& words) {
                                      std::printf("%s\n", words.c_str());
                                      std::fflush(stdout);
                                    },
                                    line_typed, [] { return interrupted.load(); }};
  const auto released = [&] {
    device.release(clock.now());
    device.close();
  };
  Calibration calibration;
  try {
    calibration = calibrate(device, target.profile, target.serial, clock, person);
  } catch (...) {
    released();
    throw;
  }
  released();
  store.write(calibration);
  std::printf("Stored in %s.\n", store.file_of(calibration.profile, calibration.serial).c_str());
  return 0;
}

}  // namespace wrenchd
