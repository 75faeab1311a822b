// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/contact_backend.hpp"
#include "core/friction.hpp"
#include "core/grasp_strength.hpp"
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
  double rate_Hz = 1000.0;  ///< 500 to 8000 Hz
  Pacing pacing = Pacing::clock;
  Realtime realtime = Realtime::required;
  int priority = 45;            ///< SCHED_FIFO priority, below threaded interrupts (50)
  int cpu = -1;                 ///< -1: no affinity
  double late_limit_s = 0.020;  ///< a tick later than this raises Fault::loop_stalled
  double self_test_s = 0.5;     ///< duration of valid reports in the self-test; 0: no test
};

/// [rendering]
struct RenderingSettings {
  Method method = Method::exact;
  int planes = 47;  ///< number of planes N_delta of Eq. (40), for method = "planar"
  ContactBackend contacts = ContactBackend::native;  ///< contact detection between meshes
  double smoothing_m = 0.0;                          ///< for method = "exact": SceneSettings::smoothing_m
  FrictionSettings friction;                         ///< friction, for method = "exact"
  GraspStrength grasp;                               ///< for scenes with free bodies
};

/// Default gains of [wrench]. At 1 kHz with 1.4 ms of delay a wall is stable up to (b + B) / (T/2 + delay) =
/// 3400 N/m, for the friction b = 0.5 and the hand damping B = 6 N.s/m of the simulated device. A sixth of
/// that is firm and leaves a margin for a released handle.
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

/// Pose of one frame in another, as configuration files state it.
struct PoseSettings {
  Vector3d position_m = Vector3d::Zero();
  Vector3d rotation_vector_rad = Vector3d::Zero();  ///< axis times angle

  Pose pose() const noexcept { return {rotation_from(rotation_vector_rad), position_m}; }
};

/// Placeholder for a profile name: select the profile of the connected device.
inline constexpr const char* kAnyProfile = "auto";

/// [device]
struct DeviceSettings {
  std::string profile = "loopback";    ///< name of a profile file without .toml, or a file name with .toml
  std::filesystem::path profile_file;  ///< resolved profile file; empty for kAnyProfile
  std::string serial;      ///< serial number of the device, if several equal ones are connected; empty: any
  std::string usb_port;    ///< bus and ports of the device, "3-1.2", if it has no serial number; empty: any
  bool first_test = true;  ///< tests a device before it is armed for the first time
  PoseSettings base_in_world;   ///< X_WB: pose of the device base in the world
  PoseSettings tool_in_handle;  ///< X_HM: mesh frame of the tool in the handle frame
};

/// [recording]
struct RecordingSettings {
  std::filesystem::path file;  ///< recording of all ticks from the start; empty: none
  /// directory of recordings that are started later; empty: the default directory
  std::filesystem::path directory;
  double flight_s = 60.0;       ///< length of the flight recorder; 0: none
  int flights_kept = 10;        ///< number of flight recordings kept; older ones are deleted
  double keep_free_MB = 500.0;  ///< free disk space below which nothing is recorded
};

/// [control]
struct ControlSettings {
  std::string socket;          ///< socket path; empty: the default path; kNoSocket: none
  std::string observers;       ///< group that may connect; empty: only the daemon's user and root
  std::string operators;       ///< group that may also arm; its members must also be observers
  std::string administrators;  ///< group that may also reconfigure; its members must also be observers
};
/// Placeholder for the control socket: no socket.
inline constexpr const char* kNoSocket = "none";
/// Placeholder for the observer group: every user of this machine.
inline constexpr const char* kEverybody = "*";

/// [view]: default camera of the page. Equal points: not stated.
struct ViewSettings {
  Vector3d eye_m = Vector3d::Zero();
  Vector3d target_m = Vector3d::Zero();
};

/// Settings of wrenchd.toml.
struct Settings {
  std::filesystem::path file;
  std::string description;  ///< description of the scene and what to try, for display
  std::filesystem::path scene = "scenes/cube_on_table.toml";  ///< searched along the search path
  DeviceSettings device;
  ServoSettings servo;
  RenderingSettings rendering;
  WrenchSettings wrench;
  LimitSettings limits;           ///< [limits]
  SimulationSettings simulation;  ///< [simulation]
  RecordingSettings recording;
  ControlSettings control;
  ViewSettings view;
  std::string text = {};              ///< content of the file as it was read; empty: not from a file
  std::string hand_script_text = {};  ///< content of simulation.hand_script as it was read
};

}  // namespace wrenchd
