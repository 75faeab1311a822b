// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_hand_script.hpp"

#include <utility>

#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

/// Tolerance [m, rad] between the first and last waypoint of a repeating path; a larger difference is a jump.
constexpr double kSamePoint = 1e-9;

/// Minimum time between two waypoints.
constexpr double kMinStep_s = 0.001;

struct HandScript {
  bool repeats = true;
  std::vector<Waypoint> path;
};

void read_waypoint(TomlTable& table, HandScript& script) {
  Waypoint w;
  const TomlValue time = table.mandatory("time_s");
  const bool time_good = time.number(w.time_s, {0, 86400});
  table.mandatory("position_m").vector(w.position_m, {-10, 10});
  table.optional("rotation_vector_rad").vector(w.rotation_vector_rad, {-100, 100});
  table.optional("grasp").boolean(w.grasp);

  if (time_good && script.path.empty() && w.time_s != 0.0) time.reject("the first waypoint is at time 0");
  if (time_good && !script.path.empty() && w.time_s < script.path.back().time_s + kMinStep_s) {
    time.reject("times must ascend by 0.001 s or more; the waypoint before is at " +
                to_text(script.path.back().time_s) + " s");
  }
  script.path.push_back(w);
}

bool same_point(const Waypoint& a, const Waypoint& b) {
  return (a.position_m - b.position_m).norm() <= kSamePoint &&
         (a.rotation_vector_rad - b.rotation_vector_rad).norm() <= kSamePoint;
}

void read_script(TomlTable& table, HandScript& script) {
  table.optional("repeats").boolean(script.repeats);
  const TomlValue waypoints = table.mandatory("waypoint");
  const auto points = waypoints.elements("tables, each headed [[waypoint]]");
  for (const TomlValue& point : points) point.table(read_waypoint, script);

  if (waypoints.is_array() && points.empty()) waypoints.reject("at least one waypoint is needed");
  if (script.path.empty() || !script.repeats) return;
  if (!same_point(script.path.front(), script.path.back())) {
    points.back().reject(
        "a path that repeats ends where it starts; add such a waypoint, or set repeats = false");
  }
}

}  // namespace

std::string load_hand_script(const std::filesystem::path& file, SimulationSettings& simulation) {
  HandScript script;
  std::string text = read_config_text(file);
  read_toml_text(text, file, read_script, script);
  simulation.hand_script = file;
  simulation.hand_repeats = script.repeats;
  simulation.hand_path = std::move(script.path);
  return text;
}

}  // namespace wrenchd
