// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/setting_table.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

namespace wrenchd {
namespace {

namespace fs = std::filesystem;
using Context = SettingContext;

// --- values -----------------------------------------------------------------------------------------------

/// Upper limit of all gains, far beyond what a device renders; it catches wrong exponents.
constexpr Range kGain = {0, 1e5};
constexpr Range kGainEntry = {-1e5, 1e5};
constexpr Range kCoefficient = {0, FrictionSettings::kMaxCoefficient};

/// Replaces a file name, from the file or the default, by the file found.
bool find_file(const TomlValue& value, const Context& context, fs::path& name) {
  const auto found = context.search.find(name, context.file);
  if (!found) {
    value.reject(context.search.not_found(name, context.file));
    return false;
  }
  name = *found;
  return true;
}

bool read_file_name(const TomlValue& value, const Context& context, fs::path& name) {
  return (value.path(name) || !value) && find_file(value, context, name);
}

bool read_profile_setting(const TomlValue& value, const Context& context, DeviceSettings& device) {
  const bool good = value.text(device.profile);
  device.profile_file.clear();
  if (device.profile == kAnyProfile) return good;
  device.profile_file = profile_file(device.profile);
  return find_file(value, context, device.profile_file) && good;
}

bool read_pose_setting(const TomlValue& value, PoseSettings& pose) {
  value.table([&pose](TomlTable& table) {
    table.optional("position_m").vector(pose.position_m, {-10, 10});
    table.optional("rotation_vector_rad").vector(pose.rotation_vector_rad, {-10, 10});
  });
  return static_cast<bool>(value);
}

/// Keys of the translational and rotational gain in the table form.
struct GainKeys {
  std::string_view linear, angular;
};
constexpr GainKeys kStiffness = {"linear_N_per_m", "angular_Nm_per_rad"};
constexpr GainKeys kIntegral = {"linear_N_per_m_s", "angular_Nm_per_rad_s"};
constexpr GainKeys kDamping = {"linear_N_s_per_m", "angular_Nm_s_per_rad"};

/// Rejects a gain K with f . v = v^T K v < 0 for some v, because the law would push instead of hold. The
/// tolerance is the rounding error of an eigenvalue of a singular matrix.
void check_semidefinite(const TomlValue& value, const Matrix6d& K) {
  const Matrix6d symmetric = 0.5 * (K + K.transpose());
  const double smallest = Eigen::SelfAdjointEigenSolver<Matrix6d>(symmetric).eigenvalues().minCoeff();
  if (smallest >= -1e-9 * symmetric.norm()) return;
  value.reject("its symmetric part has the eigenvalue " + to_text(smallest) +
               "; it must have none below 0, because the law would push instead of hold");
}

bool read_gain_matrix(const TomlValue& value, Matrix6d& K) {
  const auto rows = value.elements("6 rows");
  if (rows.size() != 6) return value.reject_found("6 rows of 6 numbers");
  Matrix6d read;
  bool good = true;
  for (int i = 0; i < 6; ++i) {
    Vector6d row;
    good = rows[static_cast<std::size_t>(i)].numbers({row.data(), 6}, kGainEntry) && good;
    read.row(i) = row;
  }
  if (!good) return false;
  check_semidefinite(value, read);
  K = read;
  return true;
}

/// Three forms: k for the paper's k I, { linear.., angular.. }, or all 36 entries.
bool read_gain(const TomlValue& value, const GainKeys& keys, Matrix6d& K) {
  if (value.is_table()) {
    value.table([&](TomlTable& table) {
      double linear = 0.0;
      double angular = 0.0;
      table.mandatory(keys.linear).number(linear, kGain);
      table.mandatory(keys.angular).number(angular, kGain);
      K = WrenchGains::blockwise(linear, angular);
    });
    return true;
  }
  if (value.is_array()) return read_gain_matrix(value, K);
  double k = 0.0;
  if (!value.number(k, kGain)) return false;
  K = WrenchGains::blockwise(k, k);
  return true;
}

/// wrenchd creates the directory on the first write; a configuration may be checked on another machine.
bool read_directory(const TomlValue& value, fs::path& directory) {
  if (!value.path(directory)) return false;
  if (directory.empty() || directory.is_absolute()) return true;
  value.reject("expected an absolute path, found \"" + printable(directory.string()) +
               "\"; a service has no working directory of its own");
  return false;
}

bool read_socket(const TomlValue& value, std::string& socket) {
  if (!value.text(socket)) return false;
  if (socket.empty() || socket == kNoSocket || socket.front() == '/') return true;
  value.reject("expected an absolute path, or \"" + std::string(kNoSocket) + "\", found \"" +
               printable(socket) + "\"; clients and daemon must use the same file");
  return false;
}

/// wrenchd checks at its start that the group exists; a configuration may be checked on another machine.
bool read_privileged_group(const TomlValue& value, std::string& group) {
  if (!value.text(group)) return false;
  if (group == kEverybody) value.reject("only observers may be everybody; name a group");
  return true;
}

// --- comparison -------------------------------------------------------------------------------------------

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

// --- the table --------------------------------------------------------------------------------------------

// WRENCHD_ROW(section, key, unit, effect, member, number, how to read `value` into `out`)
#define WRENCHD_ROW(section, key, unit, effect, member, number, ...)                              \
  Setting {                                                                                       \
    section, key, unit, Setting::Effect::effect,                                                  \
        [](const TomlValue& value, [[maybe_unused]] const Context& context, Settings& settings) { \
          [[maybe_unused]] auto& out = settings.member;                                           \
          return __VA_ARGS__;                                                                     \
        },                                                                                        \
        [](const Settings& a, const Settings& b) { return equal(a.member, b.member); },           \
        [](const Settings& from, Settings& to) { to.member = from.member; }, number               \
  }
#define WRENCHD_SETTING(section, key, unit, effect, member, ...) \
  WRENCHD_ROW(section, key, unit, effect, member, nullptr, __VA_ARGS__)
#define WRENCHD_NUMBER(section, key, effect, member, min, max)                       \
  WRENCHD_ROW(                                                                       \
      section, key, "", effect, member,                                              \
      [](const Settings& settings) { return static_cast<double>(settings.member); }, \
      value.number(out, {min, max}))
#define WRENCHD_INTEGER(section, key, effect, member, min, max)                      \
  WRENCHD_ROW(                                                                       \
      section, key, "", effect, member,                                              \
      [](const Settings& settings) { return static_cast<double>(settings.member); }, \
      value.integer(out, {min, max}))
// The content of the file that a key names.
#define WRENCHD_CONTENT(section, key, effect, member)                                   \
  Setting {                                                                             \
    section, key, "", Setting::Effect::effect, nullptr,                                 \
        [](const Settings& a, const Settings& b) { return equal(a.member, b.member); }, \
        [](const Settings& from, Settings& to) { to.member = from.member; }, nullptr    \
  }

// clang-format off
constexpr std::array kTable = {
    WRENCHD_SETTING("", "description", "", none, description, value.paragraphs(out)),
    WRENCHD_SETTING("", "scene", "", scene, scene, read_file_name(value, context, out)),
    WRENCHD_SETTING("device", "profile", "", restart, device.profile, read_profile_setting(value, context, settings.device)),
    WRENCHD_SETTING("device", "serial", "", restart, device.serial, value.text(out)),
    WRENCHD_SETTING("device", "usb_port", "", restart, device.usb_port, value.text(out)),
    WRENCHD_SETTING("device", "first_test", "", restart, device.first_test, value.boolean(out)),
    WRENCHD_SETTING("device", "base_in_world", "", restart, device.base_in_world, read_pose_setting(value, out)),
    WRENCHD_SETTING("device", "tool_in_handle", "", new_rendering, device.tool_in_handle, read_pose_setting(value, out)),
    WRENCHD_NUMBER("servo", "rate_Hz", restart, servo.rate_Hz, 500, 8000),
    WRENCHD_SETTING("servo", "pacing", "", restart, servo.pacing,
                    value.choice(out, {{"clock", Pacing::clock}, {"device", Pacing::device}})),
    WRENCHD_SETTING("servo", "realtime", "", restart, servo.realtime,
                    value.choice(out, {{"required", Realtime::required},
                                       {"best_effort", Realtime::best_effort},
                                       {"off", Realtime::off}})),
    WRENCHD_INTEGER("servo", "priority", restart, servo.priority, 1, 49),
    WRENCHD_INTEGER("servo", "cpu", restart, servo.cpu, -1, 1023),
    WRENCHD_NUMBER("servo", "late_limit_s", restart, servo.late_limit_s, 0.002, 1),
    WRENCHD_NUMBER("servo", "self_test_s", restart, servo.self_test_s, 0, 5),
    WRENCHD_SETTING("rendering", "method", "", new_rendering, rendering.method,
                    value.choice(out, {{"exact", Method::exact},
                                       {"planar", Method::planar},
                                       {"descent", Method::descent},
                                       {"translational", Method::translational}})),
    WRENCHD_INTEGER("rendering", "planes", new_rendering, rendering.planes, 1, 1000),
    WRENCHD_SETTING("rendering", "contacts", "", new_rendering, rendering.contacts,
                    value.choice(out, {{"native", ContactBackend::native}, {"cgal", ContactBackend::cgal}})),
    WRENCHD_NUMBER("rendering", "smoothing_m", new_rendering, rendering.smoothing_m, 0, 1e-3),
    WRENCHD_SETTING("rendering.friction", "static", "", new_rendering, rendering.friction.static_coefficient,
                    value.number(out, kCoefficient)),
    WRENCHD_SETTING("rendering.friction", "dynamic", "", new_rendering, rendering.friction.dynamic_coefficient,
                    value.number(out, kCoefficient)),
    WRENCHD_NUMBER("rendering.grasp", "force_N", new_rendering, rendering.grasp.force_N, 0.1, 200),
    WRENCHD_NUMBER("rendering.grasp", "torque_Nm", new_rendering, rendering.grasp.torque_Nm, 0.01, 20),
    WRENCHD_SETTING("wrench", "law", "", new_rendering, wrench.law,
                    value.choice(out, {{"pid", SpringLaw::pid}, {"energy", SpringLaw::energy}})),
    WRENCHD_SETTING("wrench", "energy_stiffness_per_s2", "per_s2", new_rendering, wrench.energy_stiffness_per_s2,
                    value.number(out, {0, 1e9})),
    WRENCHD_SETTING("wrench", "stiffness", "", new_rendering, wrench.gains.stiffness,
                    read_gain(value, kStiffness, out)),
    WRENCHD_SETTING("wrench", "integral", "", new_rendering, wrench.gains.integral, read_gain(value, kIntegral, out)),
    WRENCHD_SETTING("wrench", "damping", "", new_rendering, wrench.gains.damping, read_gain(value, kDamping, out)),
    WRENCHD_NUMBER("wrench", "integral_limit_N", new_rendering, wrench.gains.integral_limit_N, 0, 100),
    WRENCHD_NUMBER("wrench", "integral_limit_Nm", new_rendering, wrench.gains.integral_limit_Nm, 0, 10),
    WRENCHD_NUMBER("wrench", "derivative_cutoff_Hz", new_rendering, wrench.gains.derivative_cutoff_Hz, 1, 1000),
    WRENCHD_SETTING("control", "socket", "", restart, control.socket, read_socket(value, out)),
    WRENCHD_SETTING("control", "observers", "", restart, control.observers, value.text(out)),
    WRENCHD_SETTING("control", "operators", "", restart, control.operators, read_privileged_group(value, out)),
    WRENCHD_SETTING("control", "administrators", "", restart, control.administrators,
                    read_privileged_group(value, out)),
    WRENCHD_NUMBER("limits", "max_force_N", limits, limits.max_force_N, 0, 200),
    WRENCHD_NUMBER("limits", "max_torque_Nm", limits, limits.max_torque_Nm, 0, 20),
    WRENCHD_NUMBER("limits", "force_slew_N_per_s", limits, limits.force_slew_N_per_s, 1, 100000),
    WRENCHD_NUMBER("limits", "torque_slew_Nm_per_s", limits, limits.torque_slew_Nm_per_s, 0.1, 10000),
    WRENCHD_NUMBER("limits", "soft_start_s", limits, limits.soft_start_s, 0.25, 5),
    WRENCHD_SETTING("view", "eye_m", "", immediate, view.eye_m, value.vector(out, {-10, 10})),
    WRENCHD_SETTING("view", "target_m", "", immediate, view.target_m, value.vector(out, {-10, 10})),
    WRENCHD_SETTING("simulation", "hand_script", "", restart, simulation.hand_script,
                    read_file_name(value, context, out)),
    WRENCHD_CONTENT("simulation", "hand_script", restart, simulation.hand_path),
    WRENCHD_NUMBER("simulation", "hand_stiffness_N_per_m", restart, simulation.hand_stiffness_N_per_m, 0, 5000),
    WRENCHD_NUMBER("simulation", "hand_stiffness_Nm_per_rad", restart, simulation.hand_stiffness_Nm_per_rad, 0, 100),
    WRENCHD_NUMBER("simulation", "hand_damping_N_s_per_m", restart, simulation.hand_damping_N_s_per_m, 0, 100),
    WRENCHD_NUMBER("simulation", "hand_damping_Nm_s_per_rad", restart, simulation.hand_damping_Nm_s_per_rad, 0, 1),
    WRENCHD_NUMBER("simulation", "handle_mass_kg", restart, simulation.handle_mass_kg, 0.01, 10),
    WRENCHD_NUMBER("simulation", "handle_inertia_kg_m2", restart, simulation.handle_inertia_kg_m2, 1e-6, 1),
    WRENCHD_NUMBER("simulation", "viscous_friction_N_s_per_m", restart, simulation.viscous_friction_N_s_per_m, 0, 100),
    WRENCHD_NUMBER("simulation", "viscous_friction_Nm_s_per_rad", restart, simulation.viscous_friction_Nm_s_per_rad,
                   0, 1),
    WRENCHD_NUMBER("simulation", "coulomb_friction_N", restart, simulation.coulomb_friction_N, 0, 10),
    WRENCHD_NUMBER("simulation", "coulomb_friction_Nm", restart, simulation.coulomb_friction_Nm, 0, 1),
    WRENCHD_NUMBER("simulation", "position_quantum_m", restart, simulation.position_quantum_m, 0, 0.001),
    WRENCHD_NUMBER("simulation", "rotation_quantum_rad", restart, simulation.rotation_quantum_rad, 0, 0.01),
    WRENCHD_NUMBER("simulation", "actuator_max_force_N", restart, simulation.actuator_max_force_N, 0, 200),
    WRENCHD_NUMBER("simulation", "actuator_max_torque_Nm", restart, simulation.actuator_max_torque_Nm, 0, 20),
    WRENCHD_NUMBER("simulation", "report_delay_s", restart, simulation.report_delay_s, 0, 0.05),
    WRENCHD_NUMBER("simulation", "command_delay_s", restart, simulation.command_delay_s, 0, 0.05),
    WRENCHD_SETTING("simulation", "playback", "", restart, simulation.playback,
                    value.path(out) && (out.empty() || find_file(value, context, out))),
    WRENCHD_CONTENT("simulation", "playback", restart, simulation.playback_path),
    WRENCHD_SETTING("simulation", "playback_mode", "", restart, simulation.playback_mode,
                    value.choice(out, {{"open", PlaybackMode::open}, {"closed", PlaybackMode::closed}})),
    WRENCHD_SETTING("recording", "file", "", restart, recording.file, value.path(out)),
    WRENCHD_SETTING("recording", "directory", "", restart, recording.directory, read_directory(value, out)),
    WRENCHD_NUMBER("recording", "flight_s", restart, recording.flight_s, 0, 120),
    WRENCHD_INTEGER("recording", "flights_kept", restart, recording.flights_kept, 1, 1000),
    WRENCHD_NUMBER("recording", "keep_free_MB", restart, recording.keep_free_MB, 0, 1e7),
};
// clang-format on
#undef WRENCHD_ROW
#undef WRENCHD_SETTING
#undef WRENCHD_NUMBER
#undef WRENCHD_INTEGER
#undef WRENCHD_CONTENT

// --- sections ---------------------------------------------------------------------------------------------

/// The values of one section as they were read, for checks that concern more than one of them.
class SectionValues {
 public:
  void add(std::string_view key, const TomlValue& value, bool valid) {
    values_.push_back({key, value, valid});
  }
  /// Precondition: the section has the key.
  const TomlValue& value(std::string_view key) const { return find(key).value; }
  bool valid(std::string_view key) const { return find(key).valid; }

 private:
  struct Entry {
    std::string_view key;
    TomlValue value;
    bool valid;
  };
  const Entry& find(std::string_view key) const {
    return *std::find_if(values_.begin(), values_.end(),
                         [&](const Entry& entry) { return entry.key == key; });
  }
  std::vector<Entry> values_;
};

/// One coefficient alone applies to both.
void check_friction(const SectionValues& values, Settings& settings) {
  FrictionSettings& friction = settings.rendering.friction;
  const TomlValue& dynamic = values.value("dynamic");
  const bool has_static = values.valid("static");
  if (has_static && !dynamic) friction.dynamic_coefficient = friction.static_coefficient;
  if (values.valid("dynamic") && !has_static) friction.static_coefficient = friction.dynamic_coefficient;
  if (friction.dynamic_coefficient > friction.static_coefficient)
    dynamic.reject("expected no more than 'static', " + to_text(friction.static_coefficient) + ", found " +
                   to_text(friction.dynamic_coefficient) +
                   "; the dynamic coefficient of friction is not above the static one");
}

void check_rendering(const SectionValues& values, Settings& settings) {
  if (settings.rendering.friction.enabled() && settings.rendering.method != Method::exact)
    values.value("friction")
        .reject("only method = \"exact\" supports friction; choose it, or leave friction out");
  if (settings.rendering.contacts == ContactBackend::cgal && settings.rendering.method != Method::exact)
    values.value("contacts")
        .reject("only method = \"exact\" detects contacts with CGAL; choose it, or leave contacts out");
  if (settings.rendering.smoothing_m > 0.0 && settings.rendering.method != Method::exact)
    values.value("smoothing_m")
        .reject("only method = \"exact\" uses smoothed surfaces; choose it, or leave smoothing_m out");
}

struct Section {
  std::string_view name;
  bool read_if_absent;  ///< for defaults that need a lookup
  bool of_hand;         ///< each hand may have its own values
  void (*check)(const SectionValues& values, Settings& settings);
};
constexpr std::array<Section, 12> kSections = {{{"", true, false, nullptr},
                                                {"device", true, true, nullptr},
                                                {"servo", false, false, nullptr},
                                                {"rendering", false, false, check_rendering},
                                                {"rendering.friction", false, false, check_friction},
                                                {"rendering.grasp", false, false, nullptr},
                                                {"wrench", false, false, nullptr},
                                                {"limits", false, true, nullptr},
                                                {"simulation", true, true, nullptr},
                                                {"recording", false, false, nullptr},
                                                {"control", false, false, nullptr},
                                                {"view", false, false, nullptr}}};

const Section& section_named(std::string_view name) {
  return *std::find_if(kSections.begin(), kSections.end(), [&](const Section& s) { return s.name == name; });
}

/// The key of `section` in its parent's table; empty if `parent` is not its parent.
std::string_view key_in(std::string_view parent, std::string_view section) {
  if (section == parent) return {};
  std::string_view key = section;
  if (!parent.empty()) {
    if (!section.starts_with(parent) || section[parent.size()] != '.') return {};
    key.remove_prefix(parent.size() + 1);
  }
  return key.find('.') == std::string_view::npos ? key : std::string_view{};
}

/// What reading does for a key that is absent.
enum class Absent : std::uint8_t {
  look_up,  ///< searches the file that a default names
  keep,     ///< keeps the value, which was read before
};

void read_section(TomlTable& table, const Section& section, const Context& context, Absent absent,
                  Settings& settings);

TomlValue read_subsection(TomlTable& parent, std::string_view key, const Section& section,
                          const Context& context, Absent absent, Settings& settings) {
  TomlValue value = parent.optional(key);
  const auto read = [&](TomlTable& table) { read_section(table, section, context, absent, settings); };
  if (section.read_if_absent && absent == Absent::look_up)
    value.table_or_empty(read);
  else
    value.table(read);
  return value;
}

void read_section(TomlTable& table, const Section& section, const Context& context, Absent absent,
                  Settings& settings) {
  SectionValues values;
  for (const Setting& setting : kTable) {
    if (setting.section != section.name || setting.read == nullptr) continue;
    const TomlValue value = table.optional(setting.key, setting.unit);
    const bool skipped = !value && absent == Absent::keep;
    values.add(setting.key, value, !skipped && setting.read(value, context, settings));
  }
  for (const Section& inner : kSections)
    if (const std::string_view key = key_in(section.name, inner.name); !key.empty())
      values.add(key, read_subsection(table, key, inner, context, absent, settings), true);
  if (section.check != nullptr) section.check(values, settings);
}

}  // namespace

std::string Setting::name() const {
  const std::string full = section.empty() ? std::string(key) : std::string(section) + "." + std::string(key);
  return read == nullptr ? full + " (content)" : full;
}

std::span<const Setting> setting_table() noexcept {
  return kTable;
}

void read_settings(TomlTable& root, const SettingContext& context, Settings& settings) {
  read_section(root, section_named(""), context, Absent::look_up, settings);
}

std::vector<std::string_view> sections_of_hand() {
  std::vector<std::string_view> names;
  for (const Section& section : kSections)
    if (section.of_hand) names.push_back(section.name);
  return names;
}

void read_hand_settings(TomlTable& hand, const SettingContext& context, Settings& settings) {
  for (const Section& section : kSections) {
    if (section.name.empty() || section.name.find('.') != std::string_view::npos) continue;
    if (section.of_hand)
      read_subsection(hand, section.name, section, context, Absent::keep, settings);
    else if (const TomlValue common = hand.optional(section.name))
      common.reject("applies to both hands; state it outside of [[hand]]");
  }
}

void read_rendering_settings(TomlTable& root, const SettingContext& context, Settings& settings) {
  for (const std::string_view name : {"rendering", "wrench"})
    read_subsection(root, name, section_named(name), context, Absent::look_up, settings);
}

}  // namespace wrenchd
