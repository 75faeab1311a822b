// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_profile.hpp"

#include "config/load_report_layout.hpp"
#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

/// Mandatory, every one: nobody but the maker knows what a device and the hand on it can bear.
void read_limits(TomlTable& table, DeviceProfile& p) {
  table.mandatory("max_force_N").number(p.max_force_N, {0.01, 200});
  table.mandatory("max_torque_Nm").number(p.max_torque_Nm, {0.001, 20});
  table.mandatory("max_linear_speed_m_per_s").number(p.max_linear_speed_m_per_s, {0.01, 10});
  table.mandatory("max_angular_speed_rad_per_s").number(p.max_angular_speed_rad_per_s, {0.1, 100});
}

void read_profile(TomlTable& table, DeviceProfile& p) {
  const TomlValue name = table.mandatory("name");
  if (name.text(p.name) && p.name.empty()) name.refuse("must not be empty; status and records show it");
  table.optional("description").text(p.description);
  table.mandatory("transport").choice(p.transport, {{"loopback", std::string("loopback")}});
  table.mandatory("report_rate_Hz").number(p.report_rate_Hz, {10, 8000});
  table.mandatory("watchdog_s").number(p.watchdog_s, {0.001, 2});
  table.optional("stale_fault_s").number(p.stale_fault_s, {0.001, 1});
  table.optional("wrench_point")
      .choice(p.wrench_point, {{"handle", WrenchPoint::handle}, {"world_origin", WrenchPoint::world_origin}});

  table.mandatory("limits").table(read_limits, p);
  table.mandatory("pose_report").table(read_pose_report, p);
  table.mandatory("wrench_report").table(read_wrench_report, p);
}

}  // namespace

DeviceProfile load_profile(const std::filesystem::path& file) {
  DeviceProfile profile;
  read_toml(file, read_profile, profile);
  return profile;
}

}  // namespace wrenchd
