// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/live_line.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <spdlog/fmt/fmt.h>

#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "core/pose.hpp"
#include "core/state.hpp"
#include "daemon/servo/proxy_initializer.hpp"

namespace wrenchd {
namespace {

double microseconds(Duration d) {
  return 1e-3 * static_cast<double>(d.count());
}

double length(const double* v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

std::string times(const DurationHistogram& h) {
  return fmt::format("{:.1f}/{:.1f}/{:.1f}", microseconds(h.quantile(0.5)), microseconds(h.quantile(0.999)),
                     microseconds(h.max()));
}

/// Rotation angle [rad] of a pose x y z qx qy qz qw.
double angle(const std::array<double, 7>& X) {
  return 2.0 * std::atan2(length(&X[3]), std::abs(X[6]));
}

std::string state(const TickRecord& r) {
  const auto state = static_cast<State>(r.state);
  if (r.state_cause != Fault::none && (is_latched(state) || state == State::degraded))
    return fmt::format("{}:{}", name(state), fault_row(r.state_cause).name);
  if (const auto initialization = static_cast<ProxyInitialization>(r.proxy_initialization);
      initialization != ProxyInitialization::complete)
    return name(initialization);
  return name(state);
}

/// fx fy fz [N], tx ty tz [N.m].
std::array<double, 6> wrench(const TickRecord& r, ShownWrench shown) {
  if (shown == ShownWrench::sent) return r.F_out;
  const Quaterniond R_WP = pose_from_numbers(r.X_WP).rotation;
  const Vector3d f = R_WP * Vector3d(r.F_T[0], r.F_T[1], r.F_T[2]);
  const Vector3d t = R_WP * Vector3d(r.F_T[3], r.F_T[4], r.F_T[5]);
  return {f.x(), f.y(), f.z(), t.x(), t.y(), t.z()};
}

std::string remark(const TickRecord& r, ShownWrench shown) {
  if (shown == ShownWrench::on_tool) return " on the tool (no motors)";
  return r.undriven_dofs == 0 ? "" : " (no motor: " + dof_text(r.undriven_dofs) + ")";
}

}  // namespace

std::string live_line(const TickRecord& r, const LoopTiming& timing, ShownWrench shown,
                      const std::string& no_force) {
  const std::string tool =
      fmt::format("{:7.2f} s {:<8} | tool {:+6.1f} {:+6.1f} {:+6.1f} mm {:4.1f} deg | {} contacts",
                  r.device_time_s, state(r), 1e3 * r.X_WP[0], 1e3 * r.X_WP[1], 1e3 * r.X_WP[2],
                  angle(r.X_WP) * 180.0 / std::numbers::pi, r.contacts);
  if (!no_force.empty()) return tool + " | " + no_force;
  const std::array<double, 6> F = wrench(r, shown);
  return fmt::format("{} | F {:+5.2f} {:+5.2f} {:+5.2f} N | T {:+6.1f} {:+6.1f} {:+6.1f} mN.m{} | tick {} us",
                     tool, F[0], F[1], F[2], 1e3 * F[3], 1e3 * F[4], 1e3 * F[5], remark(r, shown),
                     times(timing.tick));
}

std::string summary(const LoopTotals& totals, const LoopTiming& timing, double seconds, ShownWrench shown) {
  const bool on_tool = shown == ShownWrench::on_tool;
  const double force_N = on_tool ? totals.max_force_on_tool_N : totals.max_force_sent_N;
  const double torque_Nm = on_tool ? totals.max_torque_on_tool_Nm : totals.max_torque_sent_Nm;
  std::string text = fmt::format(
      "{} ticks in {:.2f} s ({:.1f} Hz); in contact in {} ticks; largest force {:.2f} N, torque {:.1f} "
      "mN.m{}\n",
      totals.ticks.load(), seconds, totals.rate_Hz(), totals.ticks_in_contact.load(), force_N,
      1e3 * torque_Nm, on_tool ? " on the tool, not sent: no motors" : "");
  text += fmt::format("{:<14} {:>24}\n", "", "p50 / p99.9 / max [us]");
  text += fmt::format("{:<14} {:>24}\n", "wake latency", times(timing.wake_latency));
  text += fmt::format("{:<14} {:>24}\n", "tick", times(timing.tick));
  for (std::size_t i = 0; i < kStageCount; ++i)
    text += fmt::format("  {:<12} {:>24}\n", name(static_cast<Stage>(i)), times(timing.stage[i]));
  text += fmt::format("overruns {}, skipped ticks {}\n", timing.overruns.load(), timing.skipped_ticks.load());
  return text;
}

}  // namespace wrenchd
