// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Requested state of the workspace mapping.
struct WorkspaceRequest {
  static constexpr double kMinScale = 0.1;
  static constexpr double kMaxScale = 10.0;

  double scale = 1.0;                ///< Metres of tool motion per metre of handle motion.
  bool clutched = false;             ///< True if the tool stays still while the handle moves.
  std::uint32_t recentre_count = 0;  ///< Counter; each increment requests one recentring.
};

/// Maps handle poses in the device base to poses in the world, METHOD (90), (91):
///
///   R_WH = R_WB R_BH           p_WH = p_WB + s R_WB p_BH
///
/// X_WB starts as the configured base pose. Releasing the clutch and changing the scale s adapt X_WB so that
/// the tool does not move. The wrench map preserves power: the handle gets s times the force and the same
/// torque.
///
/// Frames: B device base, H handle point, W world.
class Workspace {
 public:
  /// X_WB: configured pose of the device base. RT-safe.
  explicit Workspace(const Pose& X_WB) noexcept : X_WB_configured_(X_WB), X_WB_(X_WB) {}

  /// Returns the handle pose in the world for a new pose in the base. dt_s: time since the last call; a
  /// change of scale is spread over kScaleRamp_s. RT-safe.
  Pose update(const Pose& X_BH, double dt_s) noexcept;

  /// Sets the target of the scale. RT-safe.
  void set_scale(double scale) noexcept;
  /// Holds the handle pose in the world constant from the next update() on. RT-safe.
  void engage_clutch() noexcept { clutched_ = true; }
  /// Continues from handle pose X_WH in the world. RT-safe.
  void disengage_clutch(const Pose& X_WH) noexcept;
  /// Restores the configured base pose and completes a scale change. X_WH may jump in the next update().
  /// RT-safe.
  void recentre() noexcept;

  bool clutched() const noexcept { return clutched_; }  ///< RT-safe.
  double scale() const noexcept { return scale_; }      ///< Current scale s. RT-safe.
  const Pose& X_WH() const noexcept { return X_WH_; }   ///< Result of the last update(). RT-safe.

  /// Returns the handle pose in the base for a pose in the world. Precondition: the clutch is disengaged.
  /// RT-safe.
  Pose pose_in_base(const Pose& X_WH) const noexcept {
    const Quaterniond R_BW = X_WB_.rotation.conjugate();
    return {R_BW * X_WH.rotation, R_BW * (X_WH.translation_m - X_WB_.translation_m) / scale_};
  }
  /// Returns the twist of the scaled handle point in axes of the world. RT-safe.
  Twist twist_in_world(const Twist& V_BH) const noexcept {
    const Twist V_W = expressed(X_WB_.rotation, V_BH);
    return {scale_ * V_W.linear_m_per_s, V_W.angular_rad_per_s};
  }
  /// Returns the wrench on the hand in axes of the base. F_H_W: wrench about the handle point in axes of the
  /// world. RT-safe.
  Wrench wrench_on_hand(const Wrench& F_H_W) const noexcept;

  static constexpr double kScaleRamp_s = 0.100;

 private:
  void update_base(const Pose& X_WH, const Pose& X_BH) noexcept;

  Pose X_WB_configured_;
  Pose X_WB_;
  Pose X_WH_;
  double scale_ = 1.0;
  double target_scale_ = 1.0;
  double scale_rate_per_s_ = 0.0;  ///< Rate at which scale_ approaches target_scale_.
  bool clutched_ = false;
  bool resume_pending_ = false;  ///< True after disengage_clutch() until the next update().
};

}  // namespace wrenchd
