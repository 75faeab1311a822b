// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "daemon/daemon_run.hpp"
#include "daemon/journal.hpp"
#include "daemon/options.hpp"
#include "daemon/process_signals.hpp"
#include "daemon/service_notify.hpp"

// Command line -> configuration -> run -> exit code.

namespace {

constexpr int kExitRejected =
    1;  ///< a file, a device or the kernel rejected the configuration; the loop did not start
constexpr int kExitFault = 3;  ///< the run ended with a fault that no client acknowledged

void set_up_log(bool verbose) {
  if (wrenchd::stderr_is_journal()) {
    wrenchd::log_to_journal();
  } else {
    spdlog::set_default_logger(spdlog::stderr_color_mt("wrenchd"));
    spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
  }
  if (verbose) spdlog::set_level(spdlog::level::debug);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app;
  wrenchd::Options options;
  wrenchd::add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  set_up_log(options.verbose);
  const wrenchd::ProcessSignals signals;
  wrenchd::ServiceNotify service;
  try {
    const wrenchd::Fault fault =
        wrenchd::run_daemon(wrenchd::load_run_config(options), {options, signals, service});
    return fault == wrenchd::Fault::none ? 0 : kExitFault;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wrenchd: %s\n", error.what());
    service.stopping(std::string("rejected: ") + error.what());
    return kExitRejected;
  }
}
