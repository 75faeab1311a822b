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

bool open_device(Runtime& station, DeviceWait& wait, bool at_start, const StopCondition& stop,
                 const ReportWaiting& waits) {
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
          wait.log_rejected(missing.rejected_devices());
        } catch (const std::runtime_error& error) {
          if (first_attempt) throw;
          say(spdlog::level::err, error.what(), "");
        }
        first_attempt = false;
        return false;
      },
      stop);
}

void log_device(const DeviceProfile& profile, const UsbDevice& device) {
  const DofMask sensed = sensed_dofs(profile), driven = driven_dofs(profile);
  spdlog::info("device {} ({}): senses {}, drives {}", describe(device), text(profile.transport),
               dof_text(sensed), dof_text(driven));
}

void log_missing_motors(const DeviceProfile& profile) {
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

bool choose_profile(RunConfig& plan, const StopCondition& stop, const ReportWaiting& waits) {
  DeviceWait wait;
  const KnownProfiles known = known_profiles(SearchPath());
  for (const std::string& refused : known.refused) spdlog::warn("profile refused: {}", refused);
  bool said = false;
  return wait.until(
      [&] {
        const std::vector<UsbDevice> plugged = list_usb_devices();
        const DeviceChoice choice =
            choose_device(plugged, known.profiles, {{}, plan.settings.device.serial, {}});
        if (choice.selection) {
          plan.profile = known.profiles[choice.selection->profile];
          plan.settings.device.profile_file = known.files[choice.selection->profile];
          return true;
        }
        if (!said) {
          spdlog::info("no device that has a profile is plugged in; waiting for one");
          waits("no device that has a profile is plugged in");
        }
        said = true;
        wait.log_rejected(describe_rejected(plugged, choice));
        return false;
      },
      stop);
}

std::string calibrate(Runtime& station, const UsbDevice& device, const CalibrationStore& store) {
  const DeviceProfile& profile = station.config().profile;
  const bool offsets_are_stored = profile.homing.reference == ReferenceSchedule::once;
  if (!offsets_are_stored && !profile.check_axes) return {};
  const std::string cure = "; run wrenchctl calibrate " + profile.name;
  if (device.serial.empty())
    return "its profile wants it calibrated, and it has no serial number to keep that under; leave [homing] "
           "out of a profile of your own for it";
  try {
    const auto stored = store.read(profile.name, device.serial);
    if (!stored) return "it was never calibrated" + cure;
    if (offsets_are_stored) station.device().recalibrate(apply_calibration(profile, stored->offsets));
    return {};
  } catch (const std::exception& refused) {  // a damaged file, or one of another profile
    return refused.what() + cure;
  }
}

bool wait_for_rest_pose(Runtime& station, Clock& clock, const StopCondition& stop,
                        const ReportWaiting& waits) {
  const DeviceProfile& profile = station.config().profile;
  if (profile.homing.reference != ReferenceSchedule::each_start) return true;
  DeviceHoming homing(station.device(), profile, DeviceHoming::Extent::reference_only);
  std::string said;
  while (!stop() && !homing.device_lost()) {
    clock.sleep_until(clock.now() + kHomingPeriod);
    const HomingState& state = homing.step(clock.now());
    if (const std::string words = operator_instruction(state); words != said) {
      spdlog::info("homing: {}", words);
      waits("homing: " + words);
      said = words;
    }
    if (state.step == HomingStep::done) return true;
  }
  return false;
}

}  // namespace wrenchd
