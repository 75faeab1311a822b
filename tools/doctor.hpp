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

/// How a machine is for a servo loop, as far as one thing goes.
enum class Health : std::uint8_t { ok, warning, failure };

struct Finding {
  Health health = Health::ok;
  std::string summary;  ///< "governor: powersave on 4 processors"
  std::string cure;     ///< empty where it is ok
};

/// How late a thread wakes up from a sleep of a millisecond.
struct WakeLatency {
  bool fifo = false;  ///< SCHED_FIFO was granted
  Duration p50{}, p999{}, max{};
};

/// A node that a plugged-in device is driven through.
struct DeviceNode {
  std::string profile;
  std::string node;       ///< "/dev/hidraw3"
  std::string port_path;  ///< of the device, "3-1.2"; empty where not on USB
  std::string group;      ///< that it belongs to
  unsigned mode = 0;      ///< permissions, as in 0660
};

/// All that is looked at. Tests give their own.
struct MachineState {
  std::filesystem::path root = "/";  ///< that etc, lib, proc, sys and usr are below
  std::string user;                  ///< who asks
  bool is_root = false;
  std::vector<std::string> groups;        ///< of the user
  std::uint64_t rtprio_limit = 0;         ///< RLIMIT_RTPRIO
  std::uint64_t memlock_limit_bytes = 0;  ///< RLIMIT_MEMLOCK; all ones: none
  std::vector<DeviceNode> nodes;
  std::vector<DeviceProfile> profiles;      ///< that there should be rules for
  std::optional<WakeLatency> wake_latency;  ///< empty: not measured
};

/// This machine, the user that runs this, what is plugged in. Opens no device. Measures nothing yet.
MachineState read_machine_state(std::vector<DeviceProfile> profiles);

/// Sleeps until every millisecond for so long, with SCHED_FIFO and locked memory where the system grants
/// them, on a thread of its own.
WakeLatency measure_wake_latency(Duration for_so_long);

/// Looks at everything, in a fixed order: kernel, processors, limits, service, rules, devices, wake-ups.
std::vector<Finding> check_machine(const MachineState& patient);

/// For a person, a line each and its cure below: "ok", "better" or "WRONG" first.
std::string text(std::span<const Finding> findings);

/// Whether something is wrong.
bool has_failure(std::span<const Finding> findings) noexcept;

}  // namespace wrenchd
