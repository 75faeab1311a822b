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

/// What a device's pose is off by, as a calibration keeps it: offsets of axes x y z rx ry rz.
///
///   p_BH = p_reported - position_m,   R_BH = R_reported exp(-rotation_rad)
struct PoseOffset {
  Vector3d position_m = Vector3d::Zero();    ///< in B
  Vector3d rotation_rad = Vector3d::Zero();  ///< axis times angle, in H
};

/// The offset with which a reported pose comes out as the pose it is known to be. RT safe.
PoseOffset offset_between(const Pose& reported, const Pose& known) noexcept;
/// The pose a device would have reported without the offset. RT safe.
Pose corrected(const Pose& reported, const PoseOffset& offset) noexcept;
/// For the store, and back; nothing where an axis has another name. Not RT safe.
std::vector<AxisOffset> axis_offsets(const PoseOffset& offset);
std::optional<PoseOffset> pose_offset(const std::vector<AxisOffset>& offsets);

enum class HomingStep : std::uint8_t {
  awaiting_sample,  ///< no good sample has come
  reference,        ///< the handle belongs into its rest
  holding_still,    ///< hold still, before the next thing is asked for
  moving,           ///< along or about one axis, in its positive direction
  done,             ///< the device may be armed
  failed,           ///< it may not, and a person has to look at it; restart() begins anew
};

enum class HomingProblem : std::uint8_t {
  none,
  device_fault,             ///< the device has one; the step waits
  not_at_reference,         ///< confirmed, and too far from where the rest is
  not_still,                ///< confirmed, and the handle moves
  wrong_axis,               ///< another axis moved instead
  wrong_direction,          ///< the axis moved the other way
  velocity_sign_mismatch,   ///< the velocity that is reported has another sign than the motion
  outside_workspace,        ///< the pose cannot be
  stored_offset_too_large,  ///< the stored offset is larger than the plan believes
};

/// Where homing stands: plain data, for the servo thread to hand on.
struct HomingState {
  HomingStep step = HomingStep::awaiting_sample;
  HomingProblem problem = HomingProblem::none;  ///< what is wrong now, or what it failed of
  std::size_t axis = 0;                         ///< 0 to 5: what is asked for, or failed
  std::size_t moved_axis = 0;                   ///< what moved instead
  double progress = 0.0;                        ///< 0 to 1, of the step
  Fault fault = Fault::none;                    ///< where the trouble is the device's

  bool operator==(const HomingState&) const = default;
};

/// What a person is told: a sentence on what to do, and one before it where something is wrong. Not RT safe.
std::string operator_instruction(const HomingState& state);

/// Watches a device until it is known where it is and that its axes go where they should. Motors are off all
/// the while: nothing here commands anything, and without `done` nothing else may.
///
/// An axis that is moved the wrong way, or confused with another, is asked for once more, since people err;
/// the second time it is the profile or a cable that errs, and homing fails. So it does where a velocity has
/// another sign than its motion, or where a pose cannot be. A device that is lost begins anew.
class Homing {
 public:
  /// Throws std::invalid_argument where the plan cannot work.
  explicit Homing(const HomingPlan& plan);
  /// The same with what the calibration store has.
  Homing(const HomingPlan& plan, const PoseOffset& stored);

  /// Begins anew. RT safe.
  void restart() noexcept;
  /// A person says that the handle is in its rest; counts for the next sample. RT safe.
  void confirm() noexcept { reference_confirmed_ = true; }
  /// Takes one sample further, as read from the device, without the offset. RT safe.
  const HomingState& advance(const DeviceSample& sample, TimePoint now) noexcept;

  const HomingState& state() const noexcept { return state_; }
  bool may_arm() const noexcept { return state_.step == HomingStep::done; }
  /// What the pose is off by; known once the reference was found.
  const PoseOffset& offset() const noexcept { return offset_; }

  // How people hold still: for so long, within so much. A hand on a table trembles by less than half of it.
  static constexpr double kStillTime_s = 0.3;
  static constexpr double kReferenceTime_s = 1.0;  ///< in the rest, where the offset is averaged
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
  bool has_stored_ = false;  // gcc 12 misreads an optional of vectors under sanitizers
  PoseOffset stored_;
  HomingState state_;
  PoseOffset offset_;
  bool reference_confirmed_ = false;
  bool axis_retried_ = false;  ///< this axis was asked for twice

  std::optional<Pose> anchor_;  ///< from where stillness and motion are measured
  TimePoint anchor_time_{};
  PoseOffset offset_sum_;         ///< of poses since the anchor, as offsets from it
  std::size_t offset_count_ = 0;  ///< of them

  std::optional<Pose> previous_pose_;  ///< pose of the last fresh sample
  double previous_time_s_ = 0.0;       ///< and its device time
  int velocity_matches_ = 0, velocity_mismatches_ = 0;
};

}  // namespace wrenchd
