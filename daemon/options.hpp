// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/run_config.hpp"
#include "daemon/runtime.hpp"

namespace CLI {
class App;
}

namespace wrenchd {

/// The command line of wrenchd. An empty text means that the option is not given.
struct Options {
  RunConfigFiles files;
  std::string simulate;
  std::string realtime;
  std::string record;
  std::string script;
  std::string playback;
  std::string playback_mode;
  std::string control;
  double seconds = 0.0;  ///< duration of the run; 0: until a signal ends it
  int link_fd = -1;      ///< -1: not given
  bool arm = false;
  bool live = false;
  bool virtual_time = false;
  bool verbose = false;
};

/// Adds the options and the help text to `app`. `options` must outlive the parsing. Not RT-safe: allocates.
void add_options(CLI::App& app, Options& options);

/// Parses the command line of the process into `options`. If the program must end now, prints --help,
/// --version or the mistake, and returns the exit code. Not RT-safe: allocates.
std::optional<int> parse_command_line(int argc, const char* const* argv, Options& options);

/// Reads the configuration files and applies the command line on top of them, for each hand. The path and the
/// faults of a simulated hand on the command line are those of the first hand. Throws ConfigError for a file
/// that it rejects, and std::runtime_error for options that contradict each other or the device. Not RT-safe:
/// reads files.
std::vector<RunConfig> load_run_configs(const Options& options);

}  // namespace wrenchd
