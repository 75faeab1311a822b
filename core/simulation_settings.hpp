// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// One point of the simulated hand's path: the goal of the handle in the device base.
struct Waypoint {
  double time_s = 0.0;
  Vector3d position_m = Vector3d::Zero();
  Vector3d rotation_vector_rad = Vector3d::Zero();  ///< axis times angle
  bool grasp = false;  ///< the hand presses the grasp button from here to the next waypoint
};

/// A pose with its time.
struct TimedPose {
  double time_s = 0.0;
  Pose X;
};

/// How the simulated hand follows a recorded path.
enum class PlaybackMode : std::uint8_t {
  open,    ///< the handle is exactly on the path; wrenches have no effect
  closed,  ///< the path is the goal of the hand, as in a hand script
};

/// Dynamics of the simulated device and of the hand that holds it.
struct SimulationSettings {
  double handle_mass_kg = 0.15;
  double handle_inertia_kg_m2 = 2.0e-4;  ///< isotropic, about the handle point
  double viscous_friction_N_s_per_m = 3.0;
  double viscous_friction_Nm_s_per_rad = 0.008;
  double coulomb_friction_N = 0.0;
  double coulomb_friction_Nm = 0.0;
  double position_quantum_m = 1.0e-5;  ///< encoder step
  double rotation_quantum_rad = 1.0e-4;
  double actuator_max_force_N = 12.0;  ///< clamp of the motors on any command
  double actuator_max_torque_Nm = 0.6;
  double report_delay_s = 0.0002;   ///< delay from the sample to its arrival at the host
  double command_delay_s = 0.0002;  ///< delay from the host to the motors
  double hand_stiffness_N_per_m = 300.0;
  double hand_stiffness_Nm_per_rad = 2.0;
  double hand_damping_N_s_per_m = 6.0;
  double hand_damping_Nm_s_per_rad = 0.03;
  bool hand_repeats = true;  ///< true: the path restarts after its last waypoint
  /// file name, searched along the search path
  std::filesystem::path hand_script = "hands/press_and_rock.toml";
  /// path from hand_script: at least one point, times strictly ascending from 0
  std::vector<Waypoint> hand_path;
  std::filesystem::path playback;  ///< recording or CSV file of poses; empty: the hand follows hand_script
  PlaybackMode playback_mode = PlaybackMode::closed;
  std::vector<TimedPose> playback_path;  ///< path from `playback`: X_BH, times strictly ascending from 0
};

}  // namespace wrenchd
