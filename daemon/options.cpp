// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/options.hpp"

#include <filesystem>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "core/files/absolute_name.hpp"
#include "daemon/command_line.hpp"
#include "daemon/guide_line.hpp"
#include "daemon/hand_file.hpp"
#include "daemon/option_checks.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
namespace {

void add_file_options(CLI::App& app, Options& options) {
  app.add_option(
         "-c,--config", options.files.config,
         "wrenchd.toml; wrenchd searches for a plain name in /etc/wrenchd, /usr/share/wrenchd, then the "
         "source tree")
      ->capture_default_str()
      ->check(not_empty());
  app.add_option("--scene", options.files.scene, "scene file; replaces the scene of the configuration")
      ->check(not_empty());
  app.add_option("--profile", options.files.profile,
                 "device profile; replaces the profile of the configuration")
      ->check(not_empty());
  app.add_option("--record", options.record, "write every tick to this HDF5 file (the file must not exist)")
      ->check(not_empty());
}

void add_device_options(CLI::App& app, Options& options) {
  app.add_option("--simulate", options.simulate,
                 "use a simulated device that has this profile, instead of a real device")
      ->check(not_empty())
      ->excludes("--profile");
  app.add_option("--loopback-script", options.script,
                 "simulated device only: script of device faults and commands (devices/README.md)")
      ->check(not_empty());
  app.add_option("--playback", options.playback,
                 "simulated device only: replay the handle motion of this recording or CSV file of poses\n"
                 "(time_s,px,py,pz,qx,qy,qz,qw: X_BH), instead of the hand script")
      ->check(not_empty());
  app.add_option("--playback-mode", options.playback_mode,
                 "replaces the mode of the configuration. open: the handle follows the poses, whatever force "
                 "acts;\nclosed: the simulated hand pulls the handle to the poses")
      ->check(one_of({"open", "closed"}));
  app.add_option("--link-fd", options.link_fd,
                 "inherited SOCK_SEQPACKET socket to a device in another process, which uses the protocol of "
                 "the profile\n(devices/README.md)")
      ->check(CLI::Range(3, 1 << 20))
      ->excludes("--simulate");
}

void add_run_options(CLI::App& app, Options& options) {
  app.add_option("--realtime", options.realtime,
                 "replaces the mode of the configuration: required, best_effort, off")
      ->check(one_of({"required", "best_effort", "off"}));
  app.add_option("--control", options.control,
                 "path of the control socket; replaces the path of the configuration; none: no socket")
      ->check(not_empty());
  app.add_option("--seconds", options.seconds,
                 "stop after this many seconds; without this option, run until Ctrl-C")
      ->check(number_in_range(0.001, 1e9));
  app.add_flag("--arm", options.arm,
               "arm as soon as the self-test passes; without this option the loop measures and the motors "
               "stay off");
  app.add_flag("--live", options.live, "show a live line, and a summary at the end");
  app.add_flag("--virtual-time", options.virtual_time,
               "simulated device only: compute as fast as possible; every run gives the same result")
      ->needs("--seconds")
      ->excludes("--link-fd");
  app.add_flag("-v,--verbose", options.verbose, "log more");
}

/// Ends the error texts of options that need a simulated device.
std::string simulate_hint(const RunConfig& config) {
  return "simulate a device, for example with --simulate " +
         (config.profile.name.empty() ? "loopback" : config.profile.name);
}

void check_device_options(const Options& options, const RunConfig& config) {
  const bool unnamed = config.profile.name.empty();
  if (!options.simulate.empty() && unnamed)
    throw std::runtime_error("--simulate auto: name the profile to simulate, as in --simulate loopback");
  if (options.virtual_time && !config.simulated)
    throw std::runtime_error("--virtual-time: a real device runs in real time; " + simulate_hint(config));
  if (config.is_second) return;  // the other options are those of the first hand
  const bool in_process = config.simulated && options.link_fd < 0;
  if (options.link_fd >= 0 && unnamed)
    throw std::runtime_error(
        "--link-fd: wrenchd cannot identify the device at the other end; name its profile with --profile");
  if (!options.script.empty() && !in_process)
    throw std::runtime_error("--loopback-script: a real device cannot run a script; " +
                             simulate_hint(config));
  if (!options.playback.empty() && !in_process)
    throw std::runtime_error("--playback: a person moves a real device; " + simulate_hint(config));
}

void apply_realtime(const Options& options, ServoSettings& servo) {
  if (options.realtime == "required") servo.realtime = Realtime::required;
  if (options.realtime == "best_effort") servo.realtime = Realtime::best_effort;
  if (options.realtime == "off" || options.virtual_time) servo.realtime = Realtime::off;
}

void apply_playback(const Options& options, SimulationSettings& simulation) {
  if (options.playback_mode == "open") simulation.playback_mode = PlaybackMode::open;
  if (options.playback_mode == "closed") simulation.playback_mode = PlaybackMode::closed;
  if (!options.playback.empty()) {
    simulation.playback = absolute_name(options.playback);
    simulation.playback_path = read_playback(simulation.playback);
  } else if (!options.playback_mode.empty() && simulation.playback.empty()) {
    throw std::runtime_error("--playback-mode: there is no playback file; name one with --playback");
  }
}

}  // namespace

void add_options(CLI::App& app, Options& options) {
  app.description(
      "wrenchd: a haptic servo daemon. It reads the pose of the device, computes the generalized\n"
      "penetration depth of the tool in its scene, and writes the wrench to the device.");
  app.footer(with_guide_line(
      "Signals: SIGHUP reads the configuration again and applies all of it, or nothing if it has an error;\n"
      "SIGUSR1 is an emergency stop; SIGUSR2 acknowledges a stop or a fault. After both the loop is "
      "disarmed.\n"
      "Exit codes: 0 stopped on request; 1 rejected (file, device, kernel); 3 ended with a fault that no\n"
      "client acknowledged; others: usage. Every exit releases the hand: zero wrench, motors off."));
  app.set_version_flag("--version", std::string("wrenchd ") + kVersion);
  add_file_options(app, options);
  add_device_options(app, options);
  add_run_options(app, options);
}

std::optional<int> parse_command_line(int argc, const char* const* argv, Options& options) {
  CLI::App app;
  add_options(app, options);
  advise_on_mistakes(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& end) {
    return app.exit(end);
  }
  return std::nullopt;
}

std::vector<RunConfig> load_run_configs(const Options& options) {
  RunConfigFiles files = options.files;
  if (!options.simulate.empty()) files.profile = options.simulate;
  files.simulate = !options.simulate.empty();
  std::vector<RunConfig> hands = load_run_configs(files, SearchPath());
  for (RunConfig& hand : hands) {
    check_device_options(options, hand);
    apply_realtime(options, hand.settings.servo);
    if (!options.record.empty()) hand.settings.recording.file = file_of_hand(options.record, hand.hand());
  }
  apply_playback(options, hands.front().settings.simulation);
  return hands;
}

}  // namespace wrenchd
