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

bool open_device(Runtime& runtime, DeviceWait& wait, bool at_start, const StopCondition& stop,
                 const ReportWaiting& waiting) {
  bool first_attempt = at_start;
  std::string reported;  // a repeated error is reported once
  const auto report = [&](spdlog::level::level_enum level, const std::string& text, const char* suffix) {
    if (text != reported) {
      spdlog::log(level, "{}{}", text, suffix);
      waiting(text);
    }
    reported = text;
  };
  return wait.until(
      [&] {
        try {
          runtime.open();
          return true;
        } catch (const DeviceNotFound& missing) {
          report(spdlog::level::info, missing.what(), "; waiting for it");
          wait.log_rejected(missing.rejected_devices());
        } catch (const std::runtime_error& error) {
          if (first_attempt) throw;
          report(spdlog::level::err, error.what(), "");
        }
        first_attempt = false;
        return false;
      },
      stop);
}

bool open_again(Runtime& runtime) {
  try {
    runtime.open();
  } catch (const std::runtime_error&) {
    return false;
  }
  spdlog::info("the device is connected again, and is disarmed");
  return true;
}

void log_unplugged(const RunContext& context) {
  spdlog::info("the simulated device was unplugged; waiting for it");
  context.service.waiting("the device was unplugged", context.hand);
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
        "the device has no motors: armed or not, the tool follows the handle and the proxy stops at "
        "obstacles; "
        "wrenchd computes and shows the wrench, and sends none");
  else if (driven != kAllDofs)
    spdlog::info("the device has no motors along {}: wrenchd drops these components of the wrench",
                 dof_text(static_cast<DofMask>(kAllDofs & ~driven)));
  if (profile.has_output && !(profile.watchdog_s > 0.0))
    spdlog::warn("the device has no watchdog of its own: wrenchd scales its limits to {:.0f} %",
                 100.0 * ProfileDevice::kAuthorityWithoutWatchdog);
}

bool choose_profile(RunConfig& config, const StopCondition& stop, const ReportWaiting& waiting) {
  DeviceWait wait;
  const KnownProfiles known = known_profiles(SearchPath());
  for (const std::string& rejected : known.rejected) spdlog::warn("profile rejected: {}", rejected);
  bool reported = false;
  return wait.until(
      [&] {
        const std::vector<UsbDevice> plugged = list_usb_devices();
        const DeviceChoice choice =
            choose_device(plugged, known.profiles,
                          {{}, config.settings.device.serial, config.settings.device.usb_port, {}});
        if (choice.selection) {
          config.profile = known.profiles[choice.selection->profile];
          config.settings.device.profile_file = known.files[choice.selection->profile];
          config.profile_texts = known.texts[choice.selection->profile];
          return true;
        }
        if (!reported) {
          spdlog::info("no device that has a profile is plugged in; waiting for one");
          waiting("no device that has a profile is plugged in");
        }
        reported = true;
        wait.log_rejected(describe_rejected(plugged, choice));
        return false;
      },
      stop);
}

std::string apply_calibration(Runtime& runtime, const UsbDevice& device, const CalibrationStore& store) {
  const DeviceProfile& profile = runtime.config().profile;
  const bool offsets_are_stored = profile.homing.reference == ReferenceSchedule::once;
  if (!offsets_are_stored && !profile.check_axes) return {};
  const std::string cure = "; run wrenchctl calibrate " + profile.name;
  if (device.serial.empty())
    return "its profile requires a calibration, which wrenchd stores by serial number, and the device has "
           "none; "
           "write a profile for it without [homing]";
  try {
    const auto stored = store.read(profile.name, device.serial);
    if (!stored) return "it is not calibrated" + cure;
    if (offsets_are_stored) runtime.device().recalibrate(apply_calibration(profile, stored->offsets));
    return {};
  } catch (const std::exception& error) {  // the file is damaged or belongs to another profile
    return error.what() + cure;
  }
}

bool wait_for_rest_pose(Runtime& runtime, Clock& clock, const StopCondition& stop,
                        const ReportWaiting& waiting) {
  const DeviceProfile& profile = runtime.config().profile;
  if (profile.homing.reference != ReferenceSchedule::each_start) return true;
  DeviceHoming homing(runtime.device(), profile, DeviceHoming::Extent::reference_only);
  std::string reported;
  while (!stop() && !homing.device_lost()) {
    clock.sleep_until(clock.now() + kHomingPeriod);
    const HomingState& state = homing.step(clock.now());
    if (const std::string instruction = operator_instruction(state); instruction != reported) {
      spdlog::info("homing: {}", instruction);
      waiting("homing: " + instruction);
      reported = instruction;
    }
    if (state.step == HomingStep::done) return true;
  }
  return false;
}

}  // namespace wrenchd
