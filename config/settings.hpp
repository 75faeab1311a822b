// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/friction.hpp"
#include "core/limits.hpp"
#include "core/method.hpp"
#include "core/pose.hpp"
#include "core/simulation_settings.hpp"
#include "core/wrench_law.hpp"

namespace wrenchd {

enum class Realtime : std::uint8_t { required, best_effort, off };
enum class Pacing : std::uint8_t { clock, device };

/// [servo]
struct ServoSettings {
  double rate_Hz = 1000.0;  ///< 500 to 8000
  Pacing pacing = Pacing::clock;
  Realtime realtime = Realtime::required;
  int priority = 45;            ///< SCHED_FIFO, below threaded interrupts (50)
  int cpu = -1;                 ///< -1: no affinity
  double late_limit_s = 0.020;  ///< a tick later than this is a loop that stood still
  double self_test_s =
      0.5;  ///< how long a device's reports have to be good before it may be armed; 0: no test
};

/// [rendering]
struct RenderingSettings {
  Method method = Method::exact;
  int planes = 47;            ///< N_delta of Eq. (40), for method = "planar"
  FrictionSettings friction;  ///< for method = "exact"
};

/// What the gains of [wrench] start from. Sampled at 1 kHz with 1.4 ms of delay, a wall is stable up to
/// (b + B) / (T/2 + delay) = 3400 N/m for the friction b = 0.5 and hand damping B = 6 N.s/m of the simulated
/// device; a sixth of that feels firm and leaves room for a hand that lets go.
inline WrenchGains default_gains() {
  WrenchGains gains;
  gains.stiffness = WrenchGains::blockwise(600.0, 1.5);
  gains.damping = WrenchGains::blockwise(1.0, 0.002);
  return gains;
}

/// [wrench]
struct WrenchSettings {
  SpringLaw law = SpringLaw::energy;
  double energy_stiffness_per_s2 = 3000.0;  ///< k of the energy law: 600 N/m for the shipped cube of 0.2 kg
  WrenchGains gains = default_gains();
};

/// Where a frame stands in another, as config files give it.
struct PoseSettings {
  Vector3d position_m = Vector3d::Zero();
  Vector3d rotation_vector_rad = Vector3d::Zero();  ///< axis times angle
};

/// In the place of a profile's name: that of whatever device is plugged in.
inline constexpr const char* kAnyProfile = "auto";

/// [device]
struct DeviceSettings {
  std::string profile = "loopback";    ///< name of a profile file, without .toml; or a file, with it
  std::filesystem::path profile_file;  ///< where the profile was found; empty for kAnyProfile
  std::string serial;                  ///< of the device, where there are several equal ones; empty: any
  PoseSettings base_in_world;          ///< X_WB
  PoseSettings tool_in_handle;         ///< X_HM: mesh frame of the tool in the handle frame
};

/// [recording]
struct RecordingSettings {
  std::filesystem::path file;       ///< of every tick from the first on; empty: none
  std::filesystem::path directory;  ///< of recordings started later; empty: the usual place
  double flight_s = 60.0;           ///< what the flight recorder holds; 0: there is none
  int flights_kept = 10;            ///< of its files, the newest
  double keep_free_MB = 500.0;      ///< of the disk: below that nothing is recorded
};

/// [control]
struct ControlSettings {
  std::string socket;          ///< path; empty: the usual place; kNoSocket: none
  std::string observers;       ///< group that may connect; empty: only the daemon's own user and root
  std::string operators;       ///< group that may arm besides; its members have to be observers too
  std::string administrators;  ///< group that may reconfigure besides, likewise
};
/// In the place of the path of the control socket.
inline constexpr const char* kNoSocket = "none";
/// In the place of the group of observers: everybody on this machine.
inline constexpr const char* kEverybody = "*";

/// [view]: from where a picture of the scene is best taken. Equal points: nobody has said.
struct ViewSettings {
  Vector3d eye_m = Vector3d::Zero();
  Vector3d target_m = Vector3d::Zero();
};

/// All of wrenchd.toml.
struct Settings {
  std::filesystem::path file;
  std::string description;  ///< what there is to feel and to see, for people
  std::filesystem::path scene = "scenes/cube_on_table.toml";  ///< looked up along the search path
  DeviceSettings device;
  ServoSettings servo;
  RenderingSettings rendering;
  WrenchSettings wrench;
  LimitSettings limits;           ///< [limits]
  SimulationSettings simulation;  ///< [simulation]
  RecordingSettings recording;
  ControlSettings control;
  ViewSettings view;
};

}  // namespace wrenchd
