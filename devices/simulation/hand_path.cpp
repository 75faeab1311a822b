// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/simulation/hand_path.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Maximum distance between the ends of a repeating path, in each coordinate [m, rad]. Above the rounding of
/// decimal fractions, far below an encoder step.
constexpr double kClosure = 1e-9;

Pose pose_of(const Waypoint& w) {
  return {rotation_from(w.rotation_vector_rad), w.position_m};
}

[[noreturn]] void reject_waypoint(std::size_t index, const std::string& why) {
  throw std::invalid_argument("hand path, waypoint " + std::to_string(index + 1) + ": " + why);
}

void check_each(const std::vector<Waypoint>& waypoints) {
  if (waypoints.empty()) throw std::invalid_argument("hand path: needs at least one waypoint");
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const Waypoint& w = waypoints[i];
    if (!is_finite(w.time_s) || !is_finite(w.position_m) || !is_finite(w.rotation_vector_rad))
      reject_waypoint(i, "a number is not finite");
    if (i == 0 && w.time_s != 0.0) reject_waypoint(i, "the first waypoint must be at time 0");
    if (i > 0 && from_seconds(w.time_s) <= from_seconds(waypoints[i - 1].time_s))
      reject_waypoint(i, "its time must be later than that of the previous waypoint");
  }
}

void check_closed(const std::vector<Waypoint>& waypoints) {
  const Waypoint& first = waypoints.front();
  const Waypoint& last = waypoints.back();
  const double gap = std::max((last.position_m - first.position_m).cwiseAbs().maxCoeff(),
                              (last.rotation_vector_rad - first.rotation_vector_rad).cwiseAbs().maxCoeff());
  if (gap > kClosure)
    reject_waypoint(waypoints.size() - 1,
                    "a repeating path must end at its start; repeat the first position and rotation here");
}

}  // namespace

HandPath::HandPath(const std::vector<Waypoint>& waypoints, bool repeats) : repeats_(repeats) {
  check_each(waypoints);
  if (repeats) check_closed(waypoints);
  for (std::size_t i = 0; i + 1 < waypoints.size(); ++i) {
    const Pose from = pose_of(waypoints[i]);
    const Pose to = pose_of(waypoints[i + 1]);
    const Duration start = from_seconds(waypoints[i].time_s);
    segments_.push_back({start, from_seconds(waypoints[i + 1].time_s) - start, from,
                         to.translation_m - from.translation_m,
                         rotation_vector(to.rotation * from.rotation.conjugate()), waypoints[i].grasp});
  }
  final_target_.X_BG = pose_of(waypoints.back());
  final_grasp_ = waypoints.back().grasp;
  end_ = from_seconds(waypoints.back().time_s);
}

HandPath::HandPath(const SimulationSettings& settings)
    : HandPath(settings.hand_path, settings.playback_path.empty() && settings.hand_repeats) {
  if (!settings.playback_path.empty()) spline_.emplace(settings.playback_path);
}

HandTarget HandPath::at(Duration since_start) const noexcept {
  HandTarget target = undisplaced(since_start);
  target.X_BG.translation_m += displacement_B_m_;
  return target;
}

bool HandPath::grasps(Duration since_start) const noexcept {
  if (spline_) return false;
  return ended(since_start) ? final_grasp_ : segment_at(since_start).grasp;
}

bool HandPath::ended(Duration since_start) const noexcept {
  return segments_.empty() || (!repeats_ && since_start >= end_);
}

/// Precondition: the path has not ended.
const HandPath::Segment& HandPath::segment_at(Duration since_start) const noexcept {
  const Duration t = std::max(since_start, Duration{0}) % end_;
  const auto next = std::upper_bound(segments_.begin(), segments_.end(), t,
                                     [](Duration time, const Segment& s) { return time < s.start; });
  return *std::prev(next);
}

HandTarget HandPath::undisplaced(Duration since_start) const noexcept {
  if (spline_) return spline_->at(since_start);
  if (ended(since_start)) return final_target_;
  const Segment& segment = segment_at(since_start);
  const Duration t = std::max(since_start, Duration{0}) % end_;
  const double u = seconds(t - segment.start) / seconds(segment.length);
  const double s = u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
  const double s_rate_Hz = 30.0 * u * u * (1.0 - u) * (1.0 - u) / seconds(segment.length);
  return {{rotation_from(s * segment.rotation_rad) * segment.X_BG.rotation,
           segment.X_BG.translation_m + s * segment.translation_m},
          {s_rate_Hz * segment.translation_m, s_rate_Hz * segment.rotation_rad}};
}

}  // namespace wrenchd
