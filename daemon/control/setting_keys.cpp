// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/setting_keys.hpp"

#include <algorithm>
#include <array>

namespace wrenchd {
namespace {

template <class T>
bool equal(const T& a, const T& b) {
  return a == b;
}
bool equal(const PoseSettings& a, const PoseSettings& b) {
  return a.position_m == b.position_m && a.rotation_vector_rad == b.rotation_vector_rad;
}
bool equal(const std::vector<Waypoint>& a, const std::vector<Waypoint>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Waypoint& x, const Waypoint& y) {
    return x.time_s == y.time_s && x.position_m == y.position_m &&
           x.rotation_vector_rad == y.rotation_vector_rad;
  });
}
bool equal(const std::vector<TimedPose>& a, const std::vector<TimedPose>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const TimedPose& x, const TimedPose& y) {
    return x.time_s == y.time_s && same_bits(x.X, y.X);
  });
}

#define WRENCHD_KEY(name, takes, member)                                                \
  SettingKey {                                                                          \
    name, SettingKey::Effect::takes,                                                    \
        [](const Settings& a, const Settings& b) { return equal(a.member, b.member); }, \
        [](const Settings& from, Settings& to) { to.member = from.member; }             \
  }
constexpr std::array kKeys = {
    WRENCHD_KEY("device.profile", restart, device.profile),
    WRENCHD_KEY("device.serial", restart, device.serial),
    WRENCHD_KEY("device.base_in_world", restart, device.base_in_world),
    WRENCHD_KEY("device.tool_in_handle", new_rendering, device.tool_in_handle),
    WRENCHD_KEY("servo.rate_Hz", restart, servo.rate_Hz),
    WRENCHD_KEY("servo.pacing", restart, servo.pacing),
    WRENCHD_KEY("servo.realtime", restart, servo.realtime),
    WRENCHD_KEY("servo.priority", restart, servo.priority),
    WRENCHD_KEY("servo.cpu", restart, servo.cpu),
    WRENCHD_KEY("servo.late_limit_s", restart, servo.late_limit_s),
    WRENCHD_KEY("servo.self_test_s", restart, servo.self_test_s),
    WRENCHD_KEY("rendering.method", new_rendering, rendering.method),
    WRENCHD_KEY("rendering.planes", new_rendering, rendering.planes),
    WRENCHD_KEY("rendering.friction.static", new_rendering, rendering.friction.static_coefficient),
    WRENCHD_KEY("rendering.friction.dynamic", new_rendering, rendering.friction.dynamic_coefficient),
    WRENCHD_KEY("wrench.law", new_rendering, wrench.law),
    WRENCHD_KEY("wrench.energy_stiffness_per_s2", new_rendering, wrench.energy_stiffness_per_s2),
    WRENCHD_KEY("wrench.stiffness", new_rendering, wrench.gains.stiffness),
    WRENCHD_KEY("wrench.integral", new_rendering, wrench.gains.integral),
    WRENCHD_KEY("wrench.damping", new_rendering, wrench.gains.damping),
    WRENCHD_KEY("wrench.integral_limit_N", new_rendering, wrench.gains.integral_limit_N),
    WRENCHD_KEY("wrench.integral_limit_Nm", new_rendering, wrench.gains.integral_limit_Nm),
    WRENCHD_KEY("wrench.derivative_cutoff_Hz", new_rendering, wrench.gains.derivative_cutoff_Hz),
    WRENCHD_KEY("control.socket", restart, control.socket),
    WRENCHD_KEY("control.observers", restart, control.observers),
    WRENCHD_KEY("control.operators", restart, control.operators),
    WRENCHD_KEY("control.administrators", restart, control.administrators),
    WRENCHD_KEY("limits.max_force_N", limits, limits.max_force_N),
    WRENCHD_KEY("limits.max_torque_Nm", limits, limits.max_torque_Nm),
    WRENCHD_KEY("limits.force_slew_N_per_s", limits, limits.force_slew_N_per_s),
    WRENCHD_KEY("limits.torque_slew_Nm_per_s", limits, limits.torque_slew_Nm_per_s),
    WRENCHD_KEY("limits.soft_start_s", limits, limits.soft_start_s),
    WRENCHD_KEY("view.eye_m", immediate, view.eye_m),
    WRENCHD_KEY("view.target_m", immediate, view.target_m),
    WRENCHD_KEY("simulation.hand_script", restart, simulation.hand_script),
    WRENCHD_KEY("simulation.hand_script (what it says)", restart, simulation.hand_path),
    WRENCHD_KEY("simulation.hand_stiffness_N_per_m", restart, simulation.hand_stiffness_N_per_m),
    WRENCHD_KEY("simulation.hand_stiffness_Nm_per_rad", restart, simulation.hand_stiffness_Nm_per_rad),
    WRENCHD_KEY("simulation.hand_damping_N_s_per_m", restart, simulation.hand_damping_N_s_per_m),
    WRENCHD_KEY("simulation.hand_damping_Nm_s_per_rad", restart, simulation.hand_damping_Nm_s_per_rad),
    WRENCHD_KEY("simulation.handle_mass_kg", restart, simulation.handle_mass_kg),
    WRENCHD_KEY("simulation.handle_inertia_kg_m2", restart, simulation.handle_inertia_kg_m2),
    WRENCHD_KEY("simulation.viscous_friction_N_s_per_m", restart, simulation.viscous_friction_N_s_per_m),
    WRENCHD_KEY("simulation.viscous_friction_Nm_s_per_rad", restart,
                simulation.viscous_friction_Nm_s_per_rad),
    WRENCHD_KEY("simulation.coulomb_friction_N", restart, simulation.coulomb_friction_N),
    WRENCHD_KEY("simulation.coulomb_friction_Nm", restart, simulation.coulomb_friction_Nm),
    WRENCHD_KEY("simulation.position_quantum_m", restart, simulation.position_quantum_m),
    WRENCHD_KEY("simulation.rotation_quantum_rad", restart, simulation.rotation_quantum_rad),
    WRENCHD_KEY("simulation.actuator_max_force_N", restart, simulation.actuator_max_force_N),
    WRENCHD_KEY("simulation.actuator_max_torque_Nm", restart, simulation.actuator_max_torque_Nm),
    WRENCHD_KEY("simulation.report_delay_s", restart, simulation.report_delay_s),
    WRENCHD_KEY("simulation.command_delay_s", restart, simulation.command_delay_s),
    WRENCHD_KEY("simulation.playback", restart, simulation.playback),
    WRENCHD_KEY("simulation.playback (what it says)", restart, simulation.playback_path),
    WRENCHD_KEY("simulation.playback_mode", restart, simulation.playback_mode),
    WRENCHD_KEY("recording.file", restart, recording.file),
    WRENCHD_KEY("recording.directory", restart, recording.directory),
    WRENCHD_KEY("recording.flight_s", restart, recording.flight_s),
    WRENCHD_KEY("recording.flights_kept", restart, recording.flights_kept),
    WRENCHD_KEY("recording.keep_free_MB", restart, recording.keep_free_MB),
};
#undef WRENCHD_KEY

}  // namespace

std::span<const SettingKey> setting_keys() noexcept {
  return kKeys;
}

}  // namespace wrenchd
