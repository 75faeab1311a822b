// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "collision/overlap_test.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/spatial.hpp"
#include "core/wrench_law.hpp"

namespace wrenchd {

/// The projection of one pose and the resulting wrench.
struct SolvedPose {
  Penetration penetration;
  Pose X_WM;   ///< pose of the mesh frame at q
  Wrench F_T;  ///< body wrench of the selected law
  Wrench F_S;  ///< spatial wrench, about the world origin
  double solve_ns = 0.0;
};

/// Returns the name of a status in tables: "free", "converged", "iteration_limit" or "infeasible". RT-safe.
const char* status_name(ProjectionStatus status) noexcept;

/// Settings of the projection and the wrench law.
struct SolveSettings {
  PenetrationDepth::Options depth;
  SpringLaw law = SpringLaw::pid;
  double k_P = 1.0;  ///< only for law pid: K_P = k_P I, without integral and derivative
  double energy_stiffness_per_s2 = 1.0;
};

/// Solves poses of a scene's tool outside of a servo loop, for programs and scripts. Poses are those of the
/// mesh frame M in the world. The constructor allocates the memory of all solves. One object serves one
/// thread. Not RT-safe.
class PoseSolver {
 public:
  /// Keeps a reference to the scene, which must outlive this object. Throws std::invalid_argument if the
  /// method does not support the scene or friction.
  PoseSolver(const Scene& scene, const SolveSettings& settings);

  /// Projects a pose without history: method exact searches the global optimum. scene_time_s: scene time of
  /// the obstacle poses [s].
  SolvedPose project(const Pose& X_WM, double scene_time_s = 0.0);

  /// Follows a trajectory as the daemon does: each answer starts from the previous one, so that the proxy
  /// never enters or crosses an obstacle. The first pose is solved without history. Pose i has scene time
  /// i / rate_Hz.
  std::vector<SolvedPose> follow(std::span<const Pose> X_WM, double rate_Hz = 1000.0);
  /// The same, but calls take(pose, answer) for each pose in turn. A stored answer has room for all contacts,
  /// some ten kilobytes.
  void follow(std::span<const Pose> X_WM, double rate_Hz,
              const std::function<void(const Pose&, SolvedPose)>& take);

  /// Returns true if the tool at this pose and an obstacle have a common point, or if one contains the other.
  /// Bodies that touch overlap.
  bool overlaps(const Pose& X_WM, double scene_time_s = 0.0);

  /// Returns true if contacts with mesh obstacles number mesh features (PenetrationDepth).
  bool uses_mesh_features() const noexcept { return depth_.uses_mesh_features(); }

  /// Returns the distance of the tool from the nearest obstacle [m]: 0 if they overlap, infinity without
  /// obstacles.
  double clearance_m(const Pose& X_WM, double scene_time_s = 0.0);

 private:
  SolvedPose answer(const Pose& X_WM, const Penetration& penetration, double solve_ns);

  const Scene& scene_;
  SolveSettings settings_;
  PenetrationDepth depth_;  ///< solves single poses
  WrenchLaw law_;
  std::unique_ptr<OverlapTest> overlap_test_;  ///< null until overlaps() needs it
};

}  // namespace wrenchd
