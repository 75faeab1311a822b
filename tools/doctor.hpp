// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"

namespace wrenchd {

/// The result of one check of the machine for a servo loop.
enum class Health : std::uint8_t { ok, warning, failure };

struct Finding {
  Health health = Health::ok;
  std::string summary;  ///< such as "governor: powersave on 4 processors"
  std::string cure;     ///< empty if there is no problem
};

/// The latency of a thread that wakes from a sleep of 1 ms.
struct WakeLatency {
  bool fifo = false;  ///< true if the system granted SCHED_FIFO
  Duration p50{}, p999{}, max{};
};

/// A device node through which wrenchd drives a connected device.
struct DeviceNode {
  std::string profile;
  std::string node;       ///< such as "/dev/hidraw3"
  std::string port_path;  ///< USB port path of the device, such as "3-1.2"; empty if the device is not on USB
  std::string group;      ///< group of the node
  unsigned mode = 0;      ///< permissions, such as 0660
};

/// All data that the checks use. Tests supply their own.
struct MachineState {
  std::filesystem::path root = "/";  ///< directory that contains etc, lib, proc, sys and usr
  std::string user;                  ///< user who runs the program
  bool is_root = false;
  std::vector<std::string> groups;        ///< groups of the user
  std::uint64_t rtprio_limit = 0;         ///< RLIMIT_RTPRIO
  std::uint64_t memlock_limit_bytes = 0;  ///< RLIMIT_MEMLOCK; all bits set: unlimited
  std::vector<DeviceNode> nodes;
  std::vector<DeviceProfile> profiles;      ///< profiles that need udev rules
  std::optional<WakeLatency> wake_latency;  ///< empty: not measured
};

/// Reads the state of this machine, its user and its connected devices. Opens no device and leaves
/// wake_latency empty. Not RT-safe: reads files.
MachineState read_machine_state(std::vector<DeviceProfile> profiles);

/// Measures for this duration how late a thread wakes every millisecond. Uses its own thread, with SCHED_FIFO
/// and locked memory if the system grants them. Not RT-safe: takes the given duration.
WakeLatency measure_wake_latency(Duration for_so_long);

/// Runs all checks in a fixed order: kernel, processors, limits, service, rules, devices, wake latency. Not
/// RT-safe: reads files.
std::vector<Finding> check_machine(const MachineState& patient);

/// Formats one line per finding, which begins with "ok", "warning" or "ERROR", and its remedy below. Not
/// RT-safe: allocates.
std::string text(std::span<const Finding> findings);

/// Returns true if any check failed. RT-safe.
bool has_failure(std::span<const Finding> findings) noexcept;

}  // namespace wrenchd
