// SPDX-License-Identifier: GPL-3.0-or-later
#include <exception>
#include <string>

#include <unistd.h>

#include "daemon/daemon_run.hpp"
#include "daemon/log_output.hpp"
#include "daemon/options.hpp"
#include "daemon/process_signals.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/standard_streams.hpp"
#include "daemon/stop_deadline.hpp"

// Command line -> configuration -> run -> exit code.

namespace {

int run(const wrenchd::Options& options, wrenchd::LogOutput& log) {
  const wrenchd::ProcessSignals signals;
  wrenchd::ServiceNotify service;
  try {
    wrenchd::StopDeadline deadline(signals, [&log] { log.close(); });
    return wrenchd::exit_code(
        wrenchd::run_daemon(wrenchd::load_run_configs(options), {options, signals, service, deadline}));
  } catch (const std::exception& error) {
    log.print_error(std::string("wrenchd: ") + error.what() + "\n");
    service.stopping(std::string("rejected: ") + error.what());
    return wrenchd::kExitRejected;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (!wrenchd::open_standard_streams()) return wrenchd::kExitRejected;
  wrenchd::Options options;
  if (const auto code = wrenchd::parse_command_line(argc, argv, options)) return *code;
  wrenchd::LogOutput log(options.verbose);
  const int code = run(options, log);
  // If the log is not read, a thread is left in a write, and must not meet the destructors of the process.
  if (!log.close()) ::_exit(code);
  return code;
}
