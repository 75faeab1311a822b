// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// What can be asked of the workspace.
struct WorkspaceRequest {
  static constexpr double kMinScale = 0.1;
  static constexpr double kMaxScale = 10.0;

  double scale = 1.0;     ///< metres that the tool goes for a metre of the handle
  bool clutched = false;  ///< the tool stands still while the handle goes elsewhere
  std::uint32_t recentre_count =
      0;  ///< goes up by one each time the tool is called back to where the handle is
};

/// How the handle's poses become poses in the world.
///
///   R_WH = R_WB R_BH           p_WH = p_WB + s R_WB p_BH
///
/// with X_WB the pose of the device base: that of the configuration, and another after the clutch was in or
/// the scale s was changed; no change of either moves the tool. The wrench on the hand has the same power at
/// the handle as in the world: s times the force, the torque as it is.
///
/// B = device base, H = handle point, W = world. All of it is RT safe.
class Workspace {
 public:
  explicit Workspace(const Pose& X_WB) noexcept : X_WB_configured_(X_WB), X_WB_(X_WB) {}

  /// The handle in the world, for a new pose in the base. dt_s: since the last; a change of scale is spread
  /// over kScaleRamp_s.
  Pose update(const Pose& X_BH, double dt_s) noexcept;

  void set_scale(double scale) noexcept;
  /// From the next follow() on the handle is where it is in the world, wherever it goes in the base.
  void engage_clutch() noexcept { clutched_ = true; }
  /// It goes on from this pose in the world.
  void disengage_clutch(const Pose& X_WH) noexcept;
  /// The base is where the configuration has it. The handle's pose in the world leaps.
  void recentre() noexcept;

  bool clutched() const noexcept { return clutched_; }
  double scale() const noexcept { return scale_; }
  double target_scale() const noexcept { return target_scale_; }
  const Pose& X_WH() const noexcept { return X_WH_; }  ///< of the last follow()

  /// A pose of the handle in the world, as it is in the base. Means nothing while the clutch is in.
  Pose pose_in_base(const Pose& X_WH) const noexcept {
    const Quaterniond R_BW = X_WB_.rotation.conjugate();
    return {R_BW * X_WH.rotation, R_BW * (X_WH.translation_m - X_WB_.translation_m) / scale_};
  }
  /// The handle's twist, as it is in the world.
  Twist twist_in_world(const Twist& V_BH) const noexcept {
    const Twist V_W = expressed(X_WB_.rotation, V_BH);
    return {scale_ * V_W.linear_m_per_s, V_W.angular_rad_per_s};
  }
  /// A wrench about the handle point in the axes of the world, as the hand gets it, in those of the base.
  Wrench wrench_on_hand(const Wrench& F_H_W) const noexcept;

  static constexpr double kScaleRamp_s = 0.100;

 private:
  void update_base(const Pose& X_WH, const Pose& X_BH) noexcept;

  Pose X_WB_configured_;
  Pose X_WB_;
  Pose X_WH_;
  double scale_ = 1.0;
  double target_scale_ = 1.0;
  double scale_rate_per_s_ = 0.0;  ///< on the way there
  bool clutched_ = false;
  bool resume_pending_ = false;  ///< from X_WH_, with the next pose
};

}  // namespace wrenchd
