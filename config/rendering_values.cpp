// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/rendering_values.hpp"

#include <array>

#include "config/load_settings.hpp"
#include "config/nearest_key.hpp"

namespace wrenchd {
namespace {

using Value = RenderingValue::Value;

/// Returns the translational or rotational gain, or the matrix if two numbers do not describe it.
Value gain(const Matrix6d& K, int index) {
  if (K == WrenchGains::blockwise(K(0, 0), K(3, 3))) return K(index, index);
  return K;
}
Value linear(const Matrix6d& K) {
  return gain(K, 0);
}
Value angular(const Matrix6d& K) {
  return gain(K, 3);
}

std::string method_name(Method method) {
  switch (method) {
    case Method::exact:
      return "exact";
    case Method::planar:
      return "planar";
    case Method::descent:
      return "descent";
    case Method::translational:
      return "translational";
  }
  return {};
}

std::string used(const Settings&) {
  return {};
}
std::string planar_only(const Settings& settings) {
  return settings.rendering.method == Method::planar ? "" : "only rendering.method planar uses it";
}
std::string energy_only(const Settings& settings) {
  return settings.wrench.law == SpringLaw::energy ? "" : "only wrench.law energy uses it";
}
std::string pid_only(const Settings& settings) {
  return settings.wrench.law == SpringLaw::pid ? "" : "only wrench.law pid uses it";
}

// clang-format off
const std::array kValues = {
    RenderingValue{"rendering.method", [](const Settings& s) -> Value { return method_name(s.rendering.method); }, used},
    RenderingValue{"rendering.planes", [](const Settings& s) -> Value { return double(s.rendering.planes); }, planar_only},
    RenderingValue{"rendering.contacts",
                   [](const Settings& s) -> Value {
                     return std::string(s.rendering.contacts == ContactBackend::native ? "native" : "cgal");
                   },
                   used},
    RenderingValue{"rendering.smoothing_m", [](const Settings& s) -> Value { return s.rendering.smoothing_m; }, used},
    RenderingValue{"rendering.friction.static",
                   [](const Settings& s) -> Value { return s.rendering.friction.static_coefficient; }, used},
    RenderingValue{"rendering.friction.dynamic",
                   [](const Settings& s) -> Value { return s.rendering.friction.dynamic_coefficient; }, used},
    RenderingValue{"rendering.grasp.force_N", [](const Settings& s) -> Value { return s.rendering.grasp.force_N; }, used},
    RenderingValue{"rendering.grasp.torque_Nm", [](const Settings& s) -> Value { return s.rendering.grasp.torque_Nm; }, used},
    RenderingValue{"wrench.law",
                   [](const Settings& s) -> Value {
                     return std::string(s.wrench.law == SpringLaw::pid ? "pid" : "energy");
                   },
                   used},
    RenderingValue{"wrench.energy_stiffness_per_s2",
                   [](const Settings& s) -> Value { return s.wrench.energy_stiffness_per_s2; }, energy_only},
    RenderingValue{"wrench.stiffness.linear_N_per_m",
                   [](const Settings& s) { return linear(s.wrench.gains.stiffness); }, pid_only},
    RenderingValue{"wrench.stiffness.angular_Nm_per_rad",
                   [](const Settings& s) { return angular(s.wrench.gains.stiffness); }, pid_only},
    RenderingValue{"wrench.integral.linear_N_per_m_s",
                   [](const Settings& s) { return linear(s.wrench.gains.integral); }, pid_only},
    RenderingValue{"wrench.integral.angular_Nm_per_rad_s",
                   [](const Settings& s) { return angular(s.wrench.gains.integral); }, pid_only},
    RenderingValue{"wrench.damping.linear_N_s_per_m",
                   [](const Settings& s) { return linear(s.wrench.gains.damping); }, used},
    RenderingValue{"wrench.damping.angular_Nm_s_per_rad",
                   [](const Settings& s) { return angular(s.wrench.gains.damping); }, used},
    RenderingValue{"wrench.integral_limit_N",
                   [](const Settings& s) -> Value { return s.wrench.gains.integral_limit_N; }, pid_only},
    RenderingValue{"wrench.integral_limit_Nm",
                   [](const Settings& s) -> Value { return s.wrench.gains.integral_limit_Nm; }, pid_only},
    RenderingValue{"wrench.derivative_cutoff_Hz",
                   [](const Settings& s) -> Value { return s.wrench.gains.derivative_cutoff_Hz; }, used},
};
// clang-format on

/// Returns the table of a configuration in which the key of this name has the value.
TomlNode table_with(std::string_view name, TomlNode value) {
  const std::size_t dot = name.find('.');
  TomlEntry entry;  // separate steps: gcc warns of an uninitialized value if one statement does all
  entry.key = std::string(name.substr(0, dot));
  entry.node =
      dot == std::string_view::npos ? std::move(value) : table_with(name.substr(dot + 1), std::move(value));
  TomlNode::Table table;
  table.push_back(std::move(entry));
  TomlNode node;
  node.value = std::move(table);
  return node;
}

}  // namespace

std::string RenderingValue::unit() const {
  return readable_unit(unit_of(name));
}

std::span<const RenderingValue> rendering_values() {
  return kValues;
}

/// Offers the loader a value that no key accepts. Its message states what the key accepts, so the ranges are
/// stated in one place, the loader.
std::string expected_text(const RenderingValue& value) {
  TomlNode wrong;
  wrong.value = true;
  const std::string before = "key '" + std::string(value.name) + "': expected ";
  const std::string after = ", found ";
  Settings settings;
  try {
    change_rendering(table_with(value.name, std::move(wrong)), "settings", settings);
  } catch (const ConfigError& error) {
    for (const Rejection& rejection : error.rejections()) {
      const std::string& message = rejection.message;
      if (!message.starts_with(before)) continue;
      return message.substr(before.size(), message.rfind(after) - before.size());
    }
  }
  return {};
}

std::vector<std::string> accepted_words(const RenderingValue& value) {
  std::vector<std::string> words;
  const std::string text = expected_text(value);
  for (std::size_t begin = text.find('"'); begin != std::string::npos; begin = text.find('"', begin)) {
    const std::size_t end = text.find('"', begin + 1);
    if (end == std::string::npos) break;
    words.push_back(text.substr(begin + 1, end - begin - 1));
    begin = end + 1;
  }
  return words;
}

std::vector<ChangedValue> changed_values(const Settings& before, const Settings& now) {
  std::vector<ChangedValue> changed;
  for (const RenderingValue& value : kValues) {
    Value old_value = value.read(before), new_value = value.read(now);
    if (old_value != new_value) changed.push_back({&value, std::move(old_value), std::move(new_value)});
  }
  return changed;
}

}  // namespace wrenchd
