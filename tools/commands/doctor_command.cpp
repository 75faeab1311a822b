// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <iostream>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/known_profiles.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/doctor.hpp"

namespace wrenchd {
namespace {

class DoctorCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* doctor = app.add_subcommand(
        "doctor",
        "Check whether this machine suits a servo loop: kernel, processors, limits, service,\n"
        "udev rules, devices and wake latency, with a remedy for each problem");
    doctor->footer(
        "Each line begins with ok, warning (an improvement is possible) or ERROR. The measurement takes one\n"
        "second. Opens no device and changes nothing. Exit code 5: a check failed.");
    doctor->callback([this] { exit_code_ = run(); });
  }

 private:
  static int run() {
    MachineState machine = read_machine_state(known_profiles(SearchPath()).profiles);
    machine.wake_latency = measure_wake_latency(std::chrono::seconds(1));
    const std::vector<Finding> findings = check_machine(machine);
    std::cout << text(findings);
    return has_failure(findings) ? kExitUnfit : kExitDone;
  }
};

}  // namespace

std::unique_ptr<Subcommand> make_doctor_command() {
  return std::make_unique<DoctorCommand>();
}

}  // namespace wrenchd
