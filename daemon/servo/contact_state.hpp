// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "collision/bodies/body_proxy.hpp"
#include "collision/penetration.hpp"
#include "core/pose.hpp"
#include "daemon/servo/proxy_initializer.hpp"

namespace wrenchd {

/// Where the hand commands the tool, and where the world lets it be. Frames: W world, B device base, H handle
/// point, P commanded pose of the tool body (the paper's p), Q its proxy (the paper's q).
struct ContactState {
  Pose X_WH;  ///< Handle pose of the rendering: without the undriven motion that passivity forbids.
  Pose X_WP;
  Pose X_WQ;  ///< Meaningless unless proxy_valid.
  bool proxy_valid =
      false;  ///< The proxy is at a feasible pose, or was found at one and follows from the next tick on.
  ProxyInitialization initialization = ProxyInitialization::searching;
  BodyPoses X_WB;                   ///< Poses of the free bodies of the scene.
  Vector6d eps = Vector6d::Zero();  ///< log(p^-1 q), Eq. (15) [m, rad].
  double energy = 0.0;              ///< T(p, q) of Eq. (8) [kg m^2].
  double kkt_residual = 0.0;
  std::uint16_t contacts = 0;
  std::uint16_t iterations = 0;
  ProjectionStatus status = ProjectionStatus::free;
  std::optional<Pose>
      X_BH_held;  ///< Pose at which the world holds the handle, in B; empty if it is not known.
  double undriven_lag_rad = 0.0;    ///< Rotation of the handle that X_WH does not contain.
  double undriven_account_J = 0.0;  ///< Energy that undriven motion of the handle may still use.
  std::uint32_t rendering_id = 0;   ///< Rendering that all of this is of.
  std::uint64_t rendering_checksum = 0;
  bool crossfading = false;  ///< Another rendering is replacing this one.

  bool following() const noexcept { return initialization == ProxyInitialization::complete; }
  /// The proxy follows, and the obstacles leave it no admissible pose.
  bool infeasible() const noexcept { return following() && status == ProjectionStatus::infeasible; }
};

}  // namespace wrenchd
