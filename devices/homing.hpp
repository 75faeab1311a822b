// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration.hpp"
#include "core/homing_plan.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Offset of the reported pose, as stored in a calibration with the axes x y z rx ry rz.
///
///   p_BH = p_reported - position_m,   R_BH = R_reported exp(-rotation_rad)
struct PoseOffset {
  Vector3d position_m = Vector3d::Zero();    ///< in B
  Vector3d rotation_rad = Vector3d::Zero();  ///< rotation vector, in H
};

/// Returns the offset that corrects the reported pose to the known pose. RT-safe.
PoseOffset offset_between(const Pose& reported, const Pose& known) noexcept;
/// Returns the reported pose without the offset. RT-safe.
Pose corrected(const Pose& reported, const PoseOffset& offset) noexcept;
/// Convert to the axes of the calibration store and back. pose_offset() returns nothing if an axis has a
/// different name. Not RT-safe: allocates.
std::vector<AxisOffset> axis_offsets(const PoseOffset& offset);
std::optional<PoseOffset> pose_offset(const std::vector<AxisOffset>& offsets);

enum class HomingStep : std::uint8_t {
  awaiting_sample,  ///< no valid sample has arrived
  reference,        ///< the operator puts the handle into the reference pose
  holding_still,    ///< the operator holds the handle still before the next step
  moving,           ///< the operator moves the handle along or about one axis, in positive direction
  done,             ///< the device may be armed
  failed,  ///< the device may not be armed; the operator must correct the problem; restart() begins again
};

enum class HomingProblem : std::uint8_t {
  none,
  device_fault,             ///< the device has a fault; the step waits
  not_at_reference,         ///< confirmed, but too far from the reference pose
  not_still,                ///< confirmed, but the handle moves
  wrong_axis,               ///< the operator moved a different axis
  wrong_direction,          ///< the axis moved in the opposite direction
  velocity_sign_mismatch,   ///< the reported velocity has the opposite sign of the motion
  outside_workspace,        ///< the pose is outside the workspace
  stored_offset_too_large,  ///< the stored offset exceeds the maximum of the plan
};

/// State of homing. Plain data, so that the servo thread can pass it on.
struct HomingState {
  HomingStep step = HomingStep::awaiting_sample;
  HomingProblem problem = HomingProblem::none;  ///< present problem, or the reason of the failure
  std::size_t axis = 0;                         ///< 0 to 5: requested axis, or the axis that failed
  std::size_t moved_axis = 0;                   ///< axis that moved instead of the requested one
  double progress = 0.0;                        ///< progress of the step, 0 to 1
  Fault fault = Fault::none;                    ///< fault of the device, if the problem is device_fault

  bool operator==(const HomingState&) const = default;
};

/// Returns the instruction for the operator: one sentence on what to do, preceded by one on the problem if
/// there is one. Not RT-safe: allocates.
std::string operator_instruction(const HomingState& state);

/// Verifies the pose and the axes of a device before arming, with the motors off. Homing sends no commands.
/// Only the step `done` permits arming.
///
/// If the operator moves an axis in the wrong direction or moves a different axis, homing asks once more. The
/// second time the profile or the wiring is wrong, and homing fails. Homing also fails if a velocity has the
/// opposite sign of its motion, or if a pose is outside the workspace. After a device is lost, homing begins
/// again.
class Homing {
 public:
  /// Throws std::invalid_argument if the plan is invalid.
  explicit Homing(const HomingPlan& plan);
  /// Uses the stored offset of the calibration store. Throws std::invalid_argument if the plan is invalid.
  Homing(const HomingPlan& plan, const PoseOffset& stored);

  /// Begins again. RT-safe.
  void restart() noexcept;
  /// The operator confirms that the handle is in the reference pose. Applies to the next sample. RT-safe.
  void confirm() noexcept { reference_confirmed_ = true; }
  /// Processes one sample as read from the device, before the offset is applied. Returns the new state.
  /// RT-safe.
  const HomingState& advance(const DeviceSample& sample, TimePoint now) noexcept;

  const HomingState& state() const noexcept { return state_; }
  /// Offset of the pose; valid after the reference pose was measured. RT-safe.
  const PoseOffset& offset() const noexcept { return offset_; }

  // The handle is still if it stays within these tolerances for this time. The tremor of a supported hand is
  // less than half of the tolerances.
  static constexpr double kStillTime_s = 0.3;
  /// Time in the reference pose, over which the offset is averaged.
  static constexpr double kReferenceTime_s = 1.0;
  static constexpr double kStillTolerance_m = 0.001;
  static constexpr double kStillTolerance_rad = 0.02;

 private:
  void begin_first_step() noexcept;
  void next_axis() noexcept;
  void measure_reference(const DeviceSample& sample, TimePoint now) noexcept;
  void wait_until_still(const Pose& X_BH, TimePoint now) noexcept;
  void track_motion(const DeviceSample& sample, const Pose& X_BH) noexcept;
  void compare_velocity(const DeviceSample& sample, const Pose& X_BH) noexcept;
  void finish_axis(std::size_t moved, bool forward) noexcept;
  bool within_workspace(const Pose& X_BH) noexcept;
  void fail(HomingProblem trouble, std::size_t axis) noexcept;
  void set_anchor(const Pose& X_BH, TimePoint now) noexcept;
  double time_still_s(const Pose& X_BH, TimePoint now) noexcept;

  HomingPlan plan_;
  bool has_stored_ = false;  // gcc 12 reports false errors for an optional of vectors under sanitizers
  PoseOffset stored_;
  HomingState state_;
  PoseOffset offset_;
  bool reference_confirmed_ = false;
  bool axis_retried_ = false;  ///< true if this axis was requested twice

  std::optional<Pose> anchor_;  ///< reference of stillness and motion
  TimePoint anchor_time_{};
  PoseOffset offset_sum_;         ///< sum of the poses since anchor_, as offsets from it
  std::size_t offset_count_ = 0;  ///< number of poses in offset_sum_

  std::optional<Pose> previous_pose_;  ///< pose of the previous fresh sample
  double previous_time_s_ = 0.0;       ///< device time of the previous fresh sample
  int velocity_matches_ = 0, velocity_mismatches_ = 0;
};

}  // namespace wrenchd
