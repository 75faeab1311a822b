// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/check.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "collision/query_cost.hpp"
#include "collision/scene.hpp"
#include "config/load_hand_script.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/toml_file.hpp"
#include "daemon/runtime.hpp"
#include "devices/profile_reports.hpp"

namespace wrenchd {
namespace {

enum class Kind { settings, scene, profile, hand_script };

bool has(const TomlNode::Table& table, const std::string& key) {
  return std::any_of(table.begin(), table.end(), [&](const TomlEntry& entry) { return entry.key == key; });
}

Kind kind_of(const std::filesystem::path& file) {
  const TomlNode root = read_toml_file(file);
  const auto& table = std::get<TomlNode::Table>(root.value);
  if (has(table, "waypoint")) return Kind::hand_script;
  if (has(table, "tool") || has(table, "obstacle")) return Kind::scene;
  if (has(table, "pose_report") || has(table, "wrench_report") || has(table, "transport") ||
      has(table, "inherits"))
    return Kind::profile;
  return Kind::settings;
}

/// Time that the estimate of the query cost may take [s].
constexpr double kEstimate_s = 2.0;
/// Part of a tick that the proxy may take. The rest of the tick is for the device and the other stages.
constexpr double kShareOfTick = 0.8;

/// Returns what contact queries cost, and a remark if a tick is too short for them.
std::string cost_text(const Scene& scene, double rate_Hz) {
  const QueryCost cost = estimate_query_cost(scene, kEstimate_s);
  if (cost.ticks == 0) return {};
  std::ostringstream text;
  text << "  contact queries: " << wrenchd::text(cost) << '\n';
  if (cost.p99_s > kShareOfTick / rate_Hz)
    text << "  remark: a tick of " << std::lround(1e6 / rate_Hz)
         << " us is too short for the meshes of this scene; lower [servo] rate_Hz, raise surface_tolerance_m "
            "in the "
            "scene, or use coarser meshes\n";
  return text.str();
}

std::string about(const SceneSettings& settings, double rate_Hz, MeshLoader& meshes) {
  const Scene scene(settings, meshes);
  const ToolBody& tool = scene.tool();
  std::ostringstream text;
  text << "  tool " << settings.tool.mesh.filename().string()
       << (settings.tool.parts.size() > 1 ? " and " + std::to_string(settings.tool.parts.size() - 1) + " more"
                                          : "")
       << (tool.kind == BodyKind::surface ? " (surface)" : "") << ": volume " << tool.solid.volume_m3
       << " m^3, mass " << settings.tool.mass_kg << " kg, " << tool.hull.vertices_T_m.size()
       << " hull vertices\n  " << scene.half_spaces().size() << " half-space(s), " << scene.meshes().size()
       << " mesh obstacle(s)" << (scene.has_moving_obstacles() ? ", moving" : "") << '\n';
  for (const FreeBody& body : scene.bodies())
    text << "  free body " << body.name << ": mass " << body.body.solid.inertia.mass_kg << " kg, "
         << body.body.mesh.triangles.size() << " triangles, friction " << body.friction << ", restitution "
         << body.restitution << '\n';
  for (const std::string& simplification : meshes.simplifications()) text << "  " << simplification << '\n';
  text << cost_text(scene, rate_Hz);
  for (const std::string& change : meshes.changes()) text << "  changed: " << change << '\n';
  for (const std::string& remark : meshes.warnings()) text << "  remark: " << remark << '\n';
  return text.str();
}

std::string about(const DeviceProfile& profile) {
  std::ostringstream text;
  text << "  device " << profile.name << ": " << profile.report_rate_Hz << " reports/s, at most "
       << profile.max_force_N << " N and " << profile.max_torque_Nm << " N.m\n";
  if (sensed_dofs(profile) != kAllDofs || driven_dofs(profile) != kAllDofs)
    text << "  the device senses " << dof_text(sensed_dofs(profile)) << " and drives "
         << dof_text(driven_dofs(profile)) << '\n';
  return text.str();
}

}  // namespace

std::string check_file(const std::filesystem::path& file, MeshLoader& meshes) {
  switch (kind_of(file)) {
    case Kind::scene:
      return file.string() + ": valid scene\n" + about(load_scene(file), ServoSettings{}.rate_Hz, meshes);
    case Kind::profile:
      return file.string() + ": valid device profile\n" + about(load_profile(file));
    case Kind::hand_script: {
      SimulationSettings simulation;
      load_hand_script(file, simulation);
      return file.string() + ": valid hand script with " + std::to_string(simulation.hand_path.size()) +
             " waypoints\n";
    }
    case Kind::settings:
      break;
  }
  std::string text = file.string() + ": valid configuration\n";
  for (const RunConfig& plan : load_run_configs({file, {}, {}, false}, SearchPath())) {
    if (plan.is_second) text += "second hand " + plan.hand() + ":\n";
    text += (plan.profile.name.empty() ? "profile: that of the connected device\n" : about(plan.profile)) +
            about(plan.scene, plan.settings.servo.rate_Hz, meshes);
  }
  return text;
}

std::string check_against_descriptor(const std::filesystem::path& profile, const DescriptorSource& device) {
  const auto expected = expected_reports(load_profile(profile));
  const auto lines = find_differences(parse_descriptor(device), expected);
  if (lines.empty()) return profile.string() + ": agrees with the report descriptor of " + device.file + '\n';
  std::string text = profile.string() + ": disagrees with the report descriptor of " + device.file +
                     "; change the profile, or name the device that it belongs to:";
  for (const std::string& line : lines) text += "\n  " + line;
  throw std::runtime_error(text);
}

}  // namespace wrenchd
