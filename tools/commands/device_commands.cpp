// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "config/known_profiles.hpp"
#include "daemon/option_checks.hpp"
#include "tools/calibrate.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/conform.hpp"
#include "tools/descriptor_source.hpp"
#include "tools/list_devices.hpp"
#include "tools/output_file.hpp"
#include "tools/propose_profile.hpp"
#include "tools/udev_rules.hpp"

namespace wrenchd {
namespace {

/// devices, udev-rules, calibrate, conform and profile.
class DeviceCommands final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    add_devices(app);
    add_udev_rules(app);
    add_calibrate(app);
    add_conform(app);
    add_profile(app);
  }

 private:
  void add_devices(CLI::App& app) {
    CLI::App* devices =
        app.add_subcommand("devices",
                           "List connected devices: the profile of each device, whether wrenchd may open\n"
                           "it, and why each other profile does not match");
    devices->add_flag("--all", all_devices_, "include the rejection reasons for unrelated devices");
    devices->footer(
        "Opens no device. Profiles come from /etc/wrenchd/profiles, /usr/share/wrenchd/profiles and\n"
        "config/profiles of the source tree; the first of several files with the same name applies.");
    devices->callback([this] {
      const auto check_open = [](const UsbDevice& device, const std::string& node) {
        return open_error(device, node);
      };
      std::cout << device_list(list_usb_devices(), known_profiles(SearchPath()), all_devices_, check_open);
    });
  }

  void add_udev_rules(CLI::App& app) {
    CLI::App* rules =
        app.add_subcommand("udev-rules",
                           "Print the udev rules for the devices of all profiles: permissions,\n"
                           "no autosuspend, and start of wrenchd when a device is connected");
    rules
        ->add_option("--from", profile_directory_,
                     "directory that contains profiles/*.toml; replaces the search path")
        ->check(not_empty());
    rules->add_option("-o,--output", output_, "rules file to write; - writes standard output")
        ->check(not_empty())
        ->capture_default_str();
    rules->callback([this] { run_udev_rules(); });
  }

  /// Adds the options that select a connected device.
  static void add_device_options(CLI::App& command, std::string& profile, std::string& serial) {
    command
        .add_option("profile", profile,
                    "name or file of the profile; auto: the profile of the connected device")
        ->check(not_empty("name a profile, or leave it out"))
        ->capture_default_str();
    command.add_option("--serial", serial, "serial number, to select one of several devices")
        ->check(not_empty("give the serial number; wrenchctl devices lists it"));
  }

  void add_calibrate(CLI::App& app) {
    CLI::App* calibrate =
        app.add_subcommand("calibrate",
                           "Calibrate a connected device with the motors off: a person moves it to its\n"
                           "reference pose and along its axes. Stores the result by serial number");
    add_device_options(*calibrate, calibration_.profile, calibration_.serial);
    calibrate->footer(
        "Shows the instructions step by step. Enter, or the button in the profile, confirms that the handle\n"
        "is at its reference pose. Calibrations are stored in calibration/ of $STATE_DIRECTORY, or of\n"
        "/var/lib/wrenchd.");
    calibrate->callback([this] { exit_code_ = run_calibrate(calibration_); });
  }

  void add_conform(CLI::App& app) {
    CLI::App* conform =
        app.add_subcommand("conform",
                           "For makers: check the rules of the open report layout with a device, one line\n"
                           "per rule, and name the section of devices/README.md that a failed rule breaks");
    add_device_options(*conform, conform_.profile, conform_.serial);
    CLI::Option* node =
        conform->add_option("--node", conform_.hidraw_node, "/dev/hidrawN, to select one of several devices")
            ->check(not_empty("give the node; wrenchctl devices lists it"));
    conform
        ->add_option("--link-fd", conform_.link_fd,
                     "inherited socket of a device in another process, instead of a connected device")
        ->check(number_in_range(0, 1e9))
        ->excludes(node);
    conform
        ->add_option("--motion", conform_.motion_s,
                     "longest time to move the handle, in seconds; 0: no motion")
        ->check(CLI::Range(0.0, 600.0))
        ->capture_default_str();
    conform->add_flag("--no-pulses", no_pulses_, "apply no force; the direction is then not judged");
    conform->footer(
        "The device gets zero wrenches and, at the end, pulses of at most 0.5 N and 0.02 N.m and a "
        "twentieth\n"
        "of the limits of the profile. Nothing is sent before its reports are valid. Ctrl-C releases it.\n"
        "Exit code 0: no rule failed. 5: a rule failed.");
    conform->callback([this] {
      conform_.pulses = !no_pulses_;
      exit_code_ = run_conform(conform_) ? kExitDone : kExitUnfit;
    });
  }

  void add_profile(CLI::App& app) {
    CLI::App* profile =
        app.add_subcommand("profile",
                           "Propose a profile for a device from its report descriptor. A person completes\n"
                           "the properties that the descriptor lacks, above all the limits");
    profile
        ->add_option("--from", descriptor_,
                     "/dev/hidrawN, or a file with a report descriptor: its bytes, or hexadecimal text")
        ->required()
        ->check(not_empty());
    profile->add_option("-o,--output", output_, "TOML file to write; - writes standard output")
        ->check(not_empty())
        ->capture_default_str();
    profile->callback([this] {
      const DescriptorSource source = read_descriptor_source(descriptor_);
      const auto fitting = fitting_profiles(source, known_profiles(SearchPath()).profiles);
      write_output(output_, propose_profile(source, fitting));
    });
  }

  void run_udev_rules() const {
    const SearchPath search = profile_directory_.empty() ? SearchPath() : SearchPath({profile_directory_});
    const KnownProfiles known = known_profiles(search);
    if (!known.rejected.empty()) throw std::runtime_error(known.rejected.front());
    if (known.profiles.empty())
      throw std::runtime_error(
          (profile_directory_.empty() ? "the search path" : profile_directory_.string()) +
          " contains no profiles/*.toml; name the parent directory of profiles");
    write_output(output_, udev_rules(known.profiles));
  }

  bool all_devices_ = false;
  std::filesystem::path profile_directory_, descriptor_;
  std::string output_ = "-";
  CalibrateOptions calibration_;
  ConformOptions conform_;
  bool no_pulses_ = false;
};

}  // namespace

std::unique_ptr<Subcommand> make_device_commands() {
  return std::make_unique<DeviceCommands>();
}

}  // namespace wrenchd
