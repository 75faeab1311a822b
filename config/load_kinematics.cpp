// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_kinematics.hpp"

#include <algorithm>
#include <numbers>

namespace wrenchd {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;
constexpr Range kLength_m = {1e-4, 2};
constexpr Range kOffset_m = {-2, 2};
constexpr Range kCounts = {-1e6, 1e6};

/// Reads the index of each joint among the integers of the report; each index appears once.
void read_report_index(const TomlValue& value, Kinematics& k) {
  std::array<double, kMaxJoints> indices{};
  if (!value.numbers({indices.data(), k.joints}, {0, static_cast<double>(k.joints - 1)})) return;
  std::array<bool, kMaxJoints> taken{};
  for (std::size_t i = 0; i < k.joints; ++i) {
    const auto index = static_cast<std::size_t>(indices[i]);
    if (static_cast<double>(index) != indices[i] || taken[index])
      return value.reject("must name each integer of joints once, from 0 to " + std::to_string(k.joints - 1));
    taken[index] = true;
    k.report_index[i] = index;
  }
}

void read_count_button(TomlTable& table, Kinematics& k) {
  Kinematics::CountButton& b = k.count_button;
  b.present = table.mandatory("report_index").integer(b.report_index, {0, static_cast<double>(k.joints - 1)});
  b.present = table.mandatory("threshold_counts").number(b.threshold_counts, kCounts) && b.present;
  b.present = table.mandatory("offset_counts").number(b.offset_counts, kCounts) && b.present;
  table.optional("button").integer(b.button, {0, 31});
}

/// Reads directions, each +1 or -1.
bool read_directions(const TomlValue& value, std::span<double> out) {
  if (!value.numbers(out, {-1, 1})) return false;
  if (std::all_of(out.begin(), out.end(), [](double d) { return d == 1.0 || d == -1.0; })) return true;
  value.reject("each must be 1 or -1");
  return false;
}

//   motor angle = 2 pi counts / counts_per_turn,   joint angle = direction capstan/body motor angle
//   current     = direction capstan/body torque / torque constant
void read_capstan_arm(TomlTable& table, Kinematics& k) {
  bool wrist = false;
  table.optional("wrist").boolean(wrist);
  k.joints = wrist ? kMaxJoints : 3;
  table.mandatory("body_length_m").vector(k.length_m, kLength_m);
  table.mandatory("origin_m").vector(k.origin_m, kOffset_m);
  Vector3d capstan = Vector3d::Ones(), body = Vector3d::Ones(), constant = Vector3d::Ones();
  table.mandatory("capstan_diameter_m").vector(capstan, kLength_m);
  table.mandatory("body_diameter_m").vector(body, kLength_m);
  table.mandatory("torque_constant_Nm_per_A").vector(constant, {1e-4, 10});
  table.mandatory("max_current_A").number(k.max_effort, {0.001, 50});
  std::array<double, kMaxJoints> per_turn, direction;
  per_turn.fill(1.0);
  direction.fill(1.0);
  table.mandatory("counts_per_turn").numbers({per_turn.data(), k.joints}, {1, 1e7});
  read_directions(table.mandatory("direction"), {direction.data(), k.joints});
  for (std::size_t i = 0; i < k.joints; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double gear = i < kMaxMotors ? direction[i] * capstan[row] / body[row] : direction[i];
    k.rad_per_count[i] = gear * kTurn_rad / per_turn[i];
    if (i < kMaxMotors) k.effort_per_Nm[i] = gear / constant[row];
  }
  k.kind = Kinematics::Kind::capstan_arm;
}

void read_delta(TomlTable& table, Kinematics& k) {
  k.joints = 3;
  table.mandatory("thigh_m").number(k.thigh_m, kLength_m);
  table.mandatory("shin_m").number(k.shin_m, kLength_m);
  table.mandatory("shin_joint_m").vector(k.shin_joint_m, kOffset_m);
  table.mandatory("leg_base_u_m").number(k.leg_base_m.x(), kOffset_m);
  table.mandatory("leg_base_v_m").number(k.leg_base_m.y(), kOffset_m);
  table.mandatory("leg_angle_rad").numbers(k.leg_angle_rad, {-7, 7});
  double per_turn = 1.0, gear = 1.0, zero_rad = 0.0, effort = 1.0;
  table.mandatory("counts_per_turn").number(per_turn, {1, 1e7});
  table.mandatory("gear").number(gear, {1e-4, 10});
  table.mandatory("zero_rad").number(zero_rad, {-7, 7});
  const TomlValue effort_value = table.mandatory("effort_per_Nm", "effort_per_Nm");
  if (effort_value.number(effort, {-1e6, 1e6}) && effort == 0.0)
    effort_value.reject("must not be 0: it is the motor effort for 1 N.m about a leg's joint");
  table.mandatory("max_effort").number(k.max_effort, {1e-3, 1e6});
  for (std::size_t i = 0; i < k.joints; ++i) {
    k.rad_per_count[i] = gear * kTurn_rad / per_turn;
    k.zero_rad[i] = zero_rad;
    k.effort_per_Nm[i] = effort;
  }
  k.kind = Kinematics::Kind::delta;
}

}  // namespace

void read_kinematics(TomlTable& table, Kinematics& k) {
  Kinematics::Kind kind = Kinematics::Kind::none;
  table.mandatory("type").choice(
      kind, {{"capstan_arm", Kinematics::Kind::capstan_arm}, {"delta", Kinematics::Kind::delta}});
  if (kind == Kinematics::Kind::capstan_arm) read_capstan_arm(table, k);
  if (kind == Kinematics::Kind::delta) read_delta(table, k);
  const TomlValue report_index = table.optional("joint_report_index");
  const TomlValue home = table.optional("home_counts");
  const TomlValue button = table.optional("count_button");
  if (k.kind == Kinematics::Kind::none) return;
  read_report_index(report_index, k);
  home.numbers({k.home_counts.data(), k.joints}, kCounts);
  if (!button.is_text("none")) button.table(read_count_button, k);
}

}  // namespace wrenchd
