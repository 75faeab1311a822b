// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/device_start.hpp"

#include <spdlog/spdlog.h>

#include "config/known_profiles.hpp"
#include "devices/device_homing.hpp"
#include "devices/discovery/choose_device.hpp"

namespace wrenchd {
namespace {

constexpr Duration kHomingPeriod = std::chrono::milliseconds(1);

}  // namespace

bool open_device(Station& station, DeviceWait& wait, bool at_start, const Stop& stop, const Waits& waits) {
  bool first_attempt = at_start;
  std::string said;  // the same trouble is told once
  const auto say = [&](spdlog::level::level_enum level, const std::string& words, const char* more) {
    if (words != said) {
      spdlog::log(level, "{}{}", words, more);
      waits(words);
    }
    said = words;
  };
  return wait.until(
      [&] {
        try {
          station.open();
          return true;
        } catch (const DeviceNotFound& missing) {
          say(spdlog::level::info, missing.what(), "; waiting for it");
          wait.tell(missing.seen());
        } catch (const std::runtime_error& error) {
          if (first_attempt) throw;
          say(spdlog::level::err, error.what(), "");
        }
        first_attempt = false;
        return false;
      },
      stop);
}

void tell_device(const DeviceProfile& profile, const UsbDevice& device) {
  const DofMask sensed = sensed_dofs(profile), driven = driven_dofs(profile);
  spdlog::info("device {} ({}): senses {}, drives {}", describe(device), text(profile.transport),
               dof_text(sensed), dof_text(driven));
}

void tell_motors(const DeviceProfile& profile) {
  const DofMask driven = driven_dofs(profile);
  if (!profile.has_output)
    spdlog::info(
        "it has no motors: the tool follows it and stops at what it touches, armed or not; the wrench is "
        "computed "
        "and shown, and felt by nobody");
  else if (driven != kAllDofs)
    spdlog::info("what the wrench has along {} is dropped: no motor pushes there",
                 dof_text(static_cast<DofMask>(kAllDofs & ~driven)));
  if (profile.has_output && !(profile.watchdog_s > 0.0))
    spdlog::warn("the device has no watchdog of its own, so it gets {:.0f} % of its limits",
                 100.0 * ProfileDevice::kAuthorityWithoutWatchdog);
}

bool settle_profile(Plan& plan, const Stop& stop, const Waits& waits) {
  DeviceWait wait;
  const KnownProfiles known = known_profiles(SearchPath());
  for (const std::string& refused : known.refused) spdlog::warn("profile refused: {}", refused);
  bool said = false;
  return wait.until(
      [&] {
        const std::vector<UsbDevice> plugged = list_usb_devices();
        const DeviceChoice choice =
            choose_device(plugged, known.profiles, {{}, plan.settings.device.serial, {}});
        if (choice.pick) {
          plan.profile = known.profiles[choice.pick->profile];
          plan.settings.device.profile_file = known.files[choice.pick->profile];
          return true;
        }
        if (!said) {
          spdlog::info("no device that has a profile is plugged in; waiting for one");
          waits("no device that has a profile is plugged in");
        }
        said = true;
        wait.tell(seen_instead(plugged, choice));
        return false;
      },
      stop);
}

std::string calibrate(Station& station, const UsbDevice& device, const CalibrationStore& store) {
  const DeviceProfile& profile = station.plan().profile;
  const bool offsets_are_stored = profile.homing.reference == ReferenceUse::once;
  if (!offsets_are_stored && !profile.check_axes) return {};
  const std::string cure = "; run wrenchctl calibrate " + profile.name;
  if (device.serial.empty())
    return "its profile wants it calibrated, and it has no serial number to keep that under; leave [homing] "
           "out of a profile of your own for it";
  try {
    const auto stored = store.read(profile.name, device.serial);
    if (!stored) return "it was never calibrated" + cure;
    if (offsets_are_stored) station.device().recalibrate(calibrated(profile, stored->offsets));
    return {};
  } catch (const std::exception& refused) {  // a damaged file, or one of another profile
    return refused.what() + cure;
  }
}

bool find_rest(Station& station, Clock& clock, const Stop& stop, const Waits& waits) {
  const DeviceProfile& profile = station.plan().profile;
  if (profile.homing.reference != ReferenceUse::each_start) return true;
  DeviceHoming homing(station.device(), profile, DeviceHoming::Extent::rest);
  std::string said;
  while (!stop() && !homing.lost()) {
    clock.sleep_until(clock.now() + kHomingPeriod);
    const HomingState& state = homing.step(clock.now());
    if (const std::string words = told(state); words != said) {
      spdlog::info("homing: {}", words);
      waits("homing: " + words);
      said = words;
    }
    if (state.step == HomingStep::done) return true;
  }
  return false;
}

}  // namespace wrenchd
