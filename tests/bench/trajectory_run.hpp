// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "collision/proxy.hpp"
#include "collision/scene.hpp"
#include "core/pose.hpp"

namespace wrenchd::bench {

/// The stiffness of the shipped scene: 600 N/m for a tool of 0.2 kg.
constexpr double kStiffness_per_s2 = 3000.0;

/// One tick of the proxy, as `wrenchctl solve --proxy --law energy` computes it.
struct ProxyTick {
  Pose X_WQ;  ///< pose of the tool's body frame
  ProjectionStatus status = ProjectionStatus::free;
  Vector3d force_W_N = Vector3d::Zero();
  std::uint32_t node_visits = 0;
  double us = 0.0;  ///< processor time of the tick, the minimum over the passes
};

/// Follows a trajectory of the tool's body frame. The first pose must be admissible. passes: number of runs,
/// which differ in their times only. After the first run further runs are made only while they take less
/// than max_s altogether.
std::vector<ProxyTick> follow_trajectory(const Scene& scene, const Proxy::WorkLimit& limit,
                                         const std::vector<Pose>& X_WP, int passes = 1, double max_s = 20.0);

/// A work limit that no tick reaches: the answer of a proxy with unlimited time.
Proxy::WorkLimit unlimited_work();

/// The differences between a run and a reference on the same trajectory.
struct LagReport {
  double behind_share = 0.0;        ///< share of ticks that differ by more than the tolerance
  std::size_t longest_ticks = 0;    ///< longest run of such ticks
  double longest_run_m = 0.0;       ///< largest difference in the longest run
  double largest_m = 0.0;           ///< largest difference of all ticks
  double force_N = 0.0;             ///< largest force of the run
  double reference_force_N = 0.0;   ///< largest force of the reference
  double force_difference_N = 0.0;  ///< largest difference of the forces at one tick
};

/// The difference between two poses: the largest displacement of a corner of the tool's bounding box.
double pose_difference_m(const Pose& X_WA, const Pose& X_WB, const std::vector<Vector3d>& corners_m) noexcept;

/// Returns the corners of the axis-parallel bounding box of the mesh.
std::vector<Vector3d> box_corners(const TriangleMesh& mesh);

/// Compares two runs of equal length. X_TC: pose of a frame C in the tool's body frame, which is equal in
/// both runs; corners_m: points in C.
LagReport compare(const std::vector<ProxyTick>& run, const Pose& X_TC,
                  const std::vector<ProxyTick>& reference, const Pose& X_RC,
                  const std::vector<Vector3d>& corners_m, double tolerance_m);

/// Returns the share of ticks with this status.
double share_of(const std::vector<ProxyTick>& run, ProjectionStatus status);

}  // namespace wrenchd::bench
