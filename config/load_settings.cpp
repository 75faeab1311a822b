// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_settings.hpp"

#include <Eigen/Eigenvalues>

#include "config/load_hand_script.hpp"
#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// The largest gain of any kind. Far beyond what a device renders; the ceiling is there for slipped
/// exponents.
constexpr Range kGain = {0, 1e5};
constexpr Range kGainEntry = {-1e5, 1e5};

/// The file that is being read, and where the names in it are looked up.
struct Lookup {
  const SearchPath& search;
  const fs::path& file;
};

/// Replaces a name, from the file or the default, by where it was found.
void find_file(const TomlValue& value, const Lookup& lookup, fs::path& name) {
  const auto found = lookup.search.find(name, lookup.file);
  if (!found) return value.refuse(lookup.search.not_found(name, lookup.file));
  name = *found;
}

void read_file_name(const TomlValue& value, const Lookup& lookup, fs::path& name) {
  if (value.path(name) || !value) find_file(value, lookup, name);
}

void read_placement(TomlTable& table, PoseSettings& placement) {
  table.optional("position_m").vector(placement.position_m, {-10, 10});
  table.optional("rotation_vector_rad").vector(placement.rotation_vector_rad, {-10, 10});
}

void read_device(TomlTable& table, const Lookup& lookup, DeviceSettings& device) {
  const TomlValue profile = table.optional("profile");
  profile.text(device.profile);
  if (device.profile != kAnyProfile) {
    device.profile_file = profile_file(device.profile);
    find_file(profile, lookup, device.profile_file);
  }
  table.optional("serial").text(device.serial);
  table.optional("base_in_world").table(read_placement, device.base_in_world);
  table.optional("tool_in_handle").table(read_placement, device.tool_in_handle);
}

void read_servo(TomlTable& table, ServoSettings& servo) {
  table.optional("rate_Hz").number(servo.rate_Hz, {500, 8000});
  table.optional("pacing").choice(servo.pacing, {{"clock", Pacing::clock}, {"device", Pacing::device}});
  table.optional("realtime")
      .choice(
          servo.realtime,
          {{"required", Realtime::required}, {"best_effort", Realtime::best_effort}, {"off", Realtime::off}});
  table.optional("priority").integer(servo.priority, {1, 49});
  table.optional("cpu").integer(servo.cpu, {-1, 1023});
  table.optional("late_limit_s").number(servo.late_limit_s, {0.002, 1});
  table.optional("self_test_s").number(servo.self_test_s, {0, 5});
}

/// One coefficient alone stands for both.
void read_friction(TomlTable& table, FrictionSettings& friction) {
  constexpr Range kCoefficient = {0, FrictionSettings::kMaxCoefficient};
  const TomlValue dynamic = table.optional("dynamic");
  const bool has_static = table.optional("static").number(friction.static_coefficient, kCoefficient);
  const bool has_dynamic = dynamic.number(friction.dynamic_coefficient, kCoefficient);
  if (has_static && !dynamic) friction.dynamic_coefficient = friction.static_coefficient;
  if (has_dynamic && !has_static) friction.static_coefficient = friction.dynamic_coefficient;
  if (friction.dynamic_coefficient > friction.static_coefficient)
    dynamic.refuse("expected no more than 'static', " + to_text(friction.static_coefficient) + ", found " +
                   to_text(friction.dynamic_coefficient) + "; what slides rubs no more than what sticks");
}

void read_rendering(TomlTable& table, RenderingSettings& rendering) {
  table.optional("method").choice(rendering.method, {{"exact", Method::exact},
                                                     {"planar", Method::planar},
                                                     {"descent", Method::descent},
                                                     {"translational", Method::translational}});
  table.optional("planes").integer(rendering.planes, {1, 1000});
  const TomlValue friction = table.optional("friction");
  friction.table(read_friction, rendering.friction);
  if (rendering.friction.enabled() && rendering.method != Method::exact)
    friction.refuse("only method = \"exact\" knows friction; choose it, or leave friction out");
}

/// How the two halves of a gain are called in its table form.
struct GainKeys {
  std::string_view linear, angular;
};

void read_blocks(TomlTable& table, const GainKeys& keys, Matrix6d& K) {
  double linear = 0.0;
  double angular = 0.0;
  table.mandatory(keys.linear).number(linear, kGain);
  table.mandatory(keys.angular).number(angular, kGain);
  K = WrenchGains::blockwise(linear, angular);
}

/// f . v = v^T K v must not be negative, or the law pushes where it should hold: the symmetric part of K has
/// no negative eigenvalue. The tolerance is the rounding of an eigenvalue of a singular matrix.
void check_semidefinite(const TomlValue& value, const Matrix6d& K) {
  const Matrix6d symmetric = 0.5 * (K + K.transpose());
  const double smallest = Eigen::SelfAdjointEigenSolver<Matrix6d>(symmetric).eigenvalues().minCoeff();
  if (smallest >= -1e-9 * symmetric.norm()) return;
  value.refuse("its symmetric part has the eigenvalue " + to_text(smallest) +
               "; it must have none below 0, or it pushes where it should hold");
}

void read_rows(const TomlValue& value, Matrix6d& K) {
  const auto rows = value.elements("6 rows");
  if (rows.size() != 6) return void(value.refuse_found("6 rows of 6 numbers"));
  Matrix6d read;
  bool good = true;
  for (int i = 0; i < 6; ++i) {
    Vector6d row;
    good = rows[static_cast<std::size_t>(i)].numbers({row.data(), 6}, kGainEntry) && good;
    read.row(i) = row;
  }
  if (!good) return;
  check_semidefinite(value, read);
  K = read;
}

/// Three forms: k for the paper's k I, { linear.., angular.. }, or all 36 entries.
void read_gain(const TomlValue& value, const GainKeys& keys, Matrix6d& K) {
  if (value.is_table()) return value.table(read_blocks, keys, K);
  if (value.is_array()) return read_rows(value, K);
  double k = 0.0;
  if (value.number(k, kGain)) K = WrenchGains::blockwise(k, k);
}

void read_wrench(TomlTable& table, WrenchSettings& wrench) {
  table.optional("law").choice(wrench.law, {{"pid", SpringLaw::pid}, {"energy", SpringLaw::energy}});
  table.optional("energy_stiffness_per_s2", "per_s2").number(wrench.energy_stiffness_per_s2, {0, 1e9});
  WrenchGains& gains = wrench.gains;
  read_gain(table.optional("stiffness"), {"linear_N_per_m", "angular_Nm_per_rad"}, gains.stiffness);
  read_gain(table.optional("integral"), {"linear_N_per_m_s", "angular_Nm_per_rad_s"}, gains.integral);
  read_gain(table.optional("damping"), {"linear_N_s_per_m", "angular_Nm_s_per_rad"}, gains.damping);
  table.optional("integral_limit_N").number(gains.integral_limit_N, {0, 100});
  table.optional("integral_limit_Nm").number(gains.integral_limit_Nm, {0, 10});
  table.optional("derivative_cutoff_Hz").number(gains.derivative_cutoff_Hz, {1, 1000});
}

void read_limits(TomlTable& table, LimitSettings& limits) {
  table.optional("max_force_N").number(limits.max_force_N, {0, 200});
  table.optional("max_torque_Nm").number(limits.max_torque_Nm, {0, 20});
  table.optional("force_slew_N_per_s").number(limits.force_slew_N_per_s, {1, 100000});
  table.optional("torque_slew_Nm_per_s").number(limits.torque_slew_Nm_per_s, {0.1, 10000});
  table.optional("soft_start_s").number(limits.soft_start_s, {0.25, 5});
}

void read_simulation(TomlTable& table, const Lookup& lookup, SimulationSettings& s) {
  read_file_name(table.optional("hand_script"), lookup, s.hand_script);
  table.optional("hand_stiffness_N_per_m").number(s.hand_stiffness_N_per_m, {0, 5000});
  table.optional("hand_stiffness_Nm_per_rad").number(s.hand_stiffness_Nm_per_rad, {0, 100});
  table.optional("hand_damping_N_s_per_m").number(s.hand_damping_N_s_per_m, {0, 100});
  table.optional("hand_damping_Nm_s_per_rad").number(s.hand_damping_Nm_s_per_rad, {0, 1});
  table.optional("handle_mass_kg").number(s.handle_mass_kg, {0.01, 10});
  table.optional("handle_inertia_kg_m2").number(s.handle_inertia_kg_m2, {1e-6, 1});
  table.optional("viscous_friction_N_s_per_m").number(s.viscous_friction_N_s_per_m, {0, 100});
  table.optional("viscous_friction_Nm_s_per_rad").number(s.viscous_friction_Nm_s_per_rad, {0, 1});
  table.optional("coulomb_friction_N").number(s.coulomb_friction_N, {0, 10});
  table.optional("coulomb_friction_Nm").number(s.coulomb_friction_Nm, {0, 1});
  table.optional("position_quantum_m").number(s.position_quantum_m, {0, 0.001});
  table.optional("rotation_quantum_rad").number(s.rotation_quantum_rad, {0, 0.01});
  table.optional("actuator_max_force_N").number(s.actuator_max_force_N, {0, 200});
  table.optional("actuator_max_torque_Nm").number(s.actuator_max_torque_Nm, {0, 20});
  table.optional("report_delay_s").number(s.report_delay_s, {0, 0.05});
  table.optional("command_delay_s").number(s.command_delay_s, {0, 0.05});
  const TomlValue playback = table.optional("playback");
  if (playback.path(s.playback) && !s.playback.empty()) find_file(playback, lookup, s.playback);
  table.optional("playback_mode")
      .choice(s.playback_mode, {{"open", PlaybackMode::open}, {"closed", PlaybackMode::closed}});
}

/// A directory is made when it is first written to; it may be there on the machine that runs and not here.
void read_recording(TomlTable& table, RecordingSettings& recording) {
  table.optional("file").path(recording.file);
  const TomlValue directory = table.optional("directory");
  if (directory.path(recording.directory) && !recording.directory.empty() &&
      !recording.directory.is_absolute())
    directory.refuse("expected an absolute path, found \"" + printable(recording.directory.string()) +
                     "\"; a service is started in no directory of its own");
  table.optional("flight_s").number(recording.flight_s, {0, 120});
  table.optional("flights_kept").integer(recording.flights_kept, {1, 1000});
  table.optional("keep_free_MB").number(recording.keep_free_MB, {0, 1e7});
}

/// Whether the groups exist is asked when the daemon starts: a configuration may be checked on another
/// machine.
void read_control(TomlTable& table, ControlSettings& control) {
  const TomlValue socket = table.optional("socket");
  if (socket.text(control.socket) && !control.socket.empty() && control.socket != kNoSocket &&
      control.socket.front() != '/')
    socket.refuse("expected an absolute path, or \"" + std::string(kNoSocket) + "\", found \"" +
                  printable(control.socket) + "\"; clients and daemon have to mean the same file");
  table.optional("observers").text(control.observers);
  for (const auto& [key, group] :
       {std::pair{"operators", &control.operators}, std::pair{"administrators", &control.administrators}}) {
    const TomlValue value = table.optional(key);
    if (value.text(*group) && *group == kEverybody)
      value.refuse("only observers may be everybody; name a group");
  }
}

void read_view(TomlTable& table, ViewSettings& view) {
  table.optional("eye_m").vector(view.eye_m, {-10, 10});
  table.optional("target_m").vector(view.target_m, {-10, 10});
}

void read_settings(TomlTable& table, const Lookup& lookup, Settings& s) {
  table.optional("description").text(s.description);
  read_file_name(table.optional("scene"), lookup, s.scene);
  table.optional("device").table_or_empty(read_device, lookup, s.device);
  table.optional("servo").table(read_servo, s.servo);
  table.optional("rendering").table(read_rendering, s.rendering);
  table.optional("wrench").table(read_wrench, s.wrench);
  table.optional("limits").table(read_limits, s.limits);
  table.optional("simulation").table_or_empty(read_simulation, lookup, s.simulation);
  table.optional("recording").table(read_recording, s.recording);
  table.optional("control").table(read_control, s.control);
  table.optional("view").table(read_view, s.view);
}

void read_rendering_changes(TomlTable& table, Settings& s) {
  table.optional("rendering").table(read_rendering, s.rendering);
  table.optional("wrench").table(read_wrench, s.wrench);
}

}  // namespace

void change_rendering(const TomlNode& changes, const fs::path& source, Settings& settings) {
  Settings changed = settings;
  read_toml_node(source, changes, read_rendering_changes, changed);
  settings = std::move(changed);
}

Settings load_settings(const fs::path& file, const SearchPath& search) {
  return load_settings(read_toml_file(file), file, search);
}

Settings load_settings(const TomlNode& tree, const fs::path& file, const SearchPath& search) {
  Settings settings;
  settings.file = file;
  read_toml_node(file, tree, read_settings, Lookup{search, file}, settings);
  load_hand_script(settings.simulation.hand_script, settings.simulation);
  return settings;
}

}  // namespace wrenchd
