// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/homing.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kAxes = 6;
constexpr std::array<const char*, kAxes> kNames = {"x", "y", "z", "rx", "ry", "rz"};

/// Instruction for the positive direction of each axis.
constexpr std::array<const char*, kAxes> kInstructions = {
    "Push the handle straight away from you.",
    "Move the handle straight to the left.",
    "Lift the handle straight up.",
    "Tip the top of the handle to the right.",
    "Tip the top of the handle away from you.",
    "Turn the handle to the left, counterclockwise as seen from above.",
};

/// Below these velocities noise and the firmware filter determine the sign.
constexpr double kMinSpeed_m_per_s = 0.01;
constexpr double kMinSpeed_rad_per_s = 0.1;
constexpr int kMinMismatches = 3;

/// Returns translation and rotation vector from one pose to another, in the base.
Vector6d displacement_between(const Pose& from, const Pose& to) noexcept {
  Vector6d displacement;
  displacement << to.translation_m - from.translation_m,
      rotation_vector(to.rotation * from.rotation.conjugate());
  return displacement;
}

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("homing plan: ") + what);
}

void check_plan(const HomingPlan& plan) {
  require(std::any_of(plan.sensed.begin(), plan.sensed.end(), [](bool s) { return s; }),
          "no axis is sensed, so there is nothing to home");
  require(plan.travel_m > 0.0 && plan.travel_m <= 0.5, "travel_m must be above 0 and 0.5 at most");
  require(plan.travel_rad > 0.0 && plan.travel_rad <= 1.5, "travel_rad must be above 0 and 1.5 at most");
  for (int i = 0; i < 3; ++i)
    require(plan.workspace_max_m[i] - plan.workspace_min_m[i] >= plan.travel_m,
            "the workspace must be larger than travel_m");
  require(plan.max_rotation_rad >= plan.travel_rad, "max_rotation_rad must be larger than travel_rad");
  require(plan.max_offset_m >= 0.0 && plan.max_offset_rad >= 0.0, "the maximum offsets must not be negative");
  require(is_finite(plan.X_BR) && std::abs(plan.X_BR.rotation.norm() - 1.0) < 1e-6,
          "the reference pose must be finite, with a unit quaternion");
}

std::string problem_text(const HomingState& state) {
  const std::string axis = state.axis < kAxes ? kNames[state.axis] : "";
  switch (state.problem) {
    case HomingProblem::none:
      return "";
    case HomingProblem::device_fault:
      return "The device: " + std::string(fault_row(state.fault).message) + " ";
    case HomingProblem::not_at_reference:
      return "The handle is too far from the reference pose, or the encoders started at a different pose. ";
    case HomingProblem::not_still:
      return "The handle is still moving. ";
    case HomingProblem::wrong_axis:
      return std::string("That moved ") + kNames[state.moved_axis] + ", not " + axis + ". ";
    case HomingProblem::wrong_direction:
      return "That moved " + axis + " in the opposite direction. ";
    case HomingProblem::velocity_sign_mismatch:
      return "The velocity that the device reports along " + axis + " has the opposite sign of the motion. ";
    case HomingProblem::outside_workspace:
      return "The pose is outside the workspace in " + axis + ". ";
    case HomingProblem::stored_offset_too_large:
      return "The stored calibration exceeds the maximum offset of the profile. ";
  }
  return "";
}

/// Returns the remedy after homing has failed.
const char* remedy_text(HomingProblem problem) {
  switch (problem) {
    case HomingProblem::wrong_axis:
      return "Axes are exchanged: check their order in the profile, and the plugs of the encoders.";
    case HomingProblem::wrong_direction:
      return "The sign is wrong: check it in the profile, and the plug of the encoder.";
    case HomingProblem::velocity_sign_mismatch:
      return "Check the sign of the velocity step in the profile, or leave the velocity out.";
    case HomingProblem::outside_workspace:
      return "Calibrate the device, and check the steps and the workspace in the profile.";
    case HomingProblem::stored_offset_too_large:
      return "Calibrate the device again.";
    default:
      return "Start again.";
  }
}

}  // namespace

PoseOffset offset_between(const Pose& reported, const Pose& known) noexcept {
  return {reported.translation_m - known.translation_m,
          rotation_vector(known.rotation.conjugate() * reported.rotation)};
}

Pose corrected(const Pose& reported, const PoseOffset& offset) noexcept {
  return {(reported.rotation * rotation_from(-offset.rotation_rad)).normalized(),
          reported.translation_m - offset.position_m};
}

std::vector<AxisOffset> axis_offsets(const PoseOffset& offset) {
  std::vector<AxisOffset> offsets;
  for (std::size_t i = 0; i < kAxes; ++i) {
    const auto k = static_cast<Eigen::Index>(i % 3);
    offsets.push_back({kNames[i], i < 3 ? offset.position_m[k] : offset.rotation_rad[k]});
  }
  return offsets;
}

std::optional<PoseOffset> pose_offset(const std::vector<AxisOffset>& offsets) {
  PoseOffset pose;
  for (const AxisOffset& offset : offsets) {
    const auto* const measured = std::find(kNames.begin(), kNames.end(), offset.axis);
    if (measured == kNames.end()) return {};
    const auto i = measured - kNames.begin();
    (i < 3 ? pose.position_m : pose.rotation_rad)[i % 3] = offset.offset;
  }
  return pose;
}

std::string operator_instruction(const HomingState& state) {
  const std::string problem = problem_text(state);
  switch (state.step) {
    case HomingStep::awaiting_sample:
      return problem + "Waiting for the device to report.";
    case HomingStep::reference:
      return problem + "Put the handle into its reference pose, release it, and confirm.";
    case HomingStep::holding_still:
      return problem + "Hold the handle still.";
    case HomingStep::moving:
      return problem + kInstructions[std::min(state.axis, kAxes - 1)];
    case HomingStep::done:
      return "Homed: the device may be armed.";
    case HomingStep::failed:
      return "Homing failed. " + problem + remedy_text(state.problem);
  }
  return "";
}

Homing::Homing(const HomingPlan& plan) : plan_(plan) {
  check_plan(plan);
  restart();
}

Homing::Homing(const HomingPlan& plan, const PoseOffset& stored) : Homing(plan) {
  has_stored_ = true;
  stored_ = stored;
  restart();
}

void Homing::restart() noexcept {
  state_ = {};
  offset_ = has_stored_ && plan_.reference != ReferenceSchedule::each_start ? stored_ : PoseOffset{};
  reference_confirmed_ = false;
  axis_retried_ = false;
  anchor_.reset();
  previous_pose_.reset();
}

const HomingState& Homing::advance(const DeviceSample& sample, TimePoint now) noexcept {
  if (sample.fault == Fault::device_lost) restart();
  if (state_.step == HomingStep::done || state_.step == HomingStep::failed) return state_;
  if (sample.fault != Fault::none) {
    state_.problem = HomingProblem::device_fault;
    state_.fault = sample.fault;
    if (state_.step == HomingStep::moving) state_.step = HomingStep::holding_still;
    anchor_.reset();
    return state_;
  }
  if (!sample.fresh) return state_;
  if (state_.problem == HomingProblem::device_fault) state_.problem = HomingProblem::none;
  state_.fault = Fault::none;

  if (state_.step == HomingStep::awaiting_sample) begin_first_step();
  if (state_.step == HomingStep::reference) {
    measure_reference(sample, now);
    return state_;
  }
  const Pose X_BH = corrected(sample.X_BH, offset_);
  if (state_.step == HomingStep::failed || !within_workspace(X_BH)) return state_;
  if (state_.step == HomingStep::moving)
    track_motion(sample, X_BH);
  else
    wait_until_still(X_BH, now);
  return state_;
}

void Homing::begin_first_step() noexcept {
  const bool needs_reference = plan_.reference == ReferenceSchedule::each_start ||
                               (plan_.reference == ReferenceSchedule::once && !has_stored_);
  if (needs_reference) {
    state_.step = HomingStep::reference;
    return;
  }
  const bool plausible =
      offset_.position_m.norm() <= plan_.max_offset_m && offset_.rotation_rad.norm() <= plan_.max_offset_rad;
  if (has_stored_ && !plausible) return fail(HomingProblem::stored_offset_too_large, 0);
  state_.axis = 0;
  next_axis();
}

/// Skips axes that are not sensed. After the last axis, holding_still leads to done.
void Homing::next_axis() noexcept {
  while (state_.axis < kAxes && !plan_.sensed[state_.axis]) ++state_.axis;
  state_.step = HomingStep::holding_still;
  state_.problem = HomingProblem::none;
  state_.progress = 0.0;
  axis_retried_ = false;
  anchor_.reset();
}

void Homing::measure_reference(const DeviceSample& sample, TimePoint now) noexcept {
  if ((sample.buttons & plan_.confirm_buttons) != 0) reference_confirmed_ = true;
  const double still_s = time_still_s(sample.X_BH, now);
  state_.progress = std::min(still_s / kReferenceTime_s, 1.0);
  if (!reference_confirmed_) return;
  if (still_s < kReferenceTime_s) {
    state_.problem = HomingProblem::not_still;
    return;
  }
  const double share = 1.0 / static_cast<double>(offset_count_);
  const Pose mean{anchor_->rotation * rotation_from(share * offset_sum_.rotation_rad),
                  anchor_->translation_m + share * offset_sum_.position_m};
  const PoseOffset measured = offset_between(mean, plan_.X_BR);
  reference_confirmed_ = false;
  if (!(measured.position_m.norm() <= plan_.max_offset_m &&
        measured.rotation_rad.norm() <= plan_.max_offset_rad)) {
    state_.problem = HomingProblem::not_at_reference;
    return;
  }
  offset_ = measured;
  state_.axis = 0;
  next_axis();
}

void Homing::wait_until_still(const Pose& X_BH, TimePoint now) noexcept {
  const double still_s = time_still_s(X_BH, now);
  state_.progress = std::min(still_s / kStillTime_s, 1.0);
  if (still_s < kStillTime_s) return;
  if (state_.axis == kAxes) {
    state_ = {};
    state_.step = HomingStep::done;
    return;
  }
  state_.step = HomingStep::moving;
  state_.progress = 0.0;
  set_anchor(X_BH, now);
  previous_pose_.reset();
  velocity_matches_ = velocity_mismatches_ = 0;
}

/// The first axis of the requested kind that moves far enough counts as the moved axis.
void Homing::track_motion(const DeviceSample& sample, const Pose& X_BH) noexcept {
  compare_velocity(sample, X_BH);
  const bool rotation = state_.axis >= 3;
  const double travel = rotation ? plan_.travel_rad : plan_.travel_m;
  const Vector6d displacement = displacement_between(*anchor_, X_BH);
  state_.progress = std::clamp(displacement[static_cast<Eigen::Index>(state_.axis)] / travel, 0.0, 1.0);
  Eigen::Index moved = 0;
  const double largest = displacement.segment<3>(rotation ? 3 : 0).cwiseAbs().maxCoeff(&moved);
  if (rotation) moved += 3;
  if (largest >= travel) finish_axis(static_cast<std::size_t>(moved), displacement[moved] > 0.0);
}

/// Only a reported velocity counts: an estimate follows from the poses and lags them.
void Homing::compare_velocity(const DeviceSample& sample, const Pose& X_BH) noexcept {
  const double elapsed_s = sample.device_time_s - previous_time_s_;
  if (previous_pose_ && elapsed_s > 0.0) {
    Vector6d V;
    V << sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s;
    const auto axis = static_cast<Eigen::Index>(state_.axis);
    const double min_speed = state_.axis < 3 ? kMinSpeed_m_per_s : kMinSpeed_rad_per_s;
    const double differenced = displacement_between(*previous_pose_, X_BH)[axis] / elapsed_s;
    const bool reported = (sample.estimated_velocity_dofs >> state_.axis & 1) == 0;
    if (reported && std::abs(V[axis]) > min_speed && std::abs(differenced) > min_speed)
      ++((V[axis] > 0.0) == (differenced > 0.0) ? velocity_matches_ : velocity_mismatches_);
  }
  previous_pose_ = X_BH;
  previous_time_s_ = sample.device_time_s;
}

void Homing::finish_axis(std::size_t moved, bool forward) noexcept {
  if (moved == state_.axis && forward) {
    if (velocity_mismatches_ >= kMinMismatches && velocity_mismatches_ > velocity_matches_)
      return fail(HomingProblem::velocity_sign_mismatch, moved);
    ++state_.axis;
    return next_axis();
  }
  const HomingProblem problem =
      moved == state_.axis ? HomingProblem::wrong_direction : HomingProblem::wrong_axis;
  state_.moved_axis = moved;
  if (axis_retried_) return fail(problem, state_.axis);
  axis_retried_ = true;
  state_.problem = problem;
  state_.step = HomingStep::holding_still;
  state_.progress = 0.0;
  anchor_.reset();
}

/// Fails homing if the pose is outside the workspace or not finite.
bool Homing::within_workspace(const Pose& X_BH) noexcept {
  const Vector3d& p = X_BH.translation_m;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (p[i] >= plan_.workspace_min_m[i] && p[i] <= plan_.workspace_max_m[i]) continue;
    fail(HomingProblem::outside_workspace, static_cast<std::size_t>(i));
    return false;
  }
  const Vector3d rotation = rotation_vector(X_BH.rotation);
  if (rotation.norm() <= plan_.max_rotation_rad) return true;
  Eigen::Index most = 0;
  rotation.cwiseAbs().maxCoeff(&most);
  fail(HomingProblem::outside_workspace, 3 + static_cast<std::size_t>(most));
  return false;
}

void Homing::fail(HomingProblem problem, std::size_t axis) noexcept {
  state_.step = HomingStep::failed;
  state_.problem = problem;
  state_.axis = axis;
  state_.progress = 0.0;
}

void Homing::set_anchor(const Pose& X_BH, TimePoint now) noexcept {
  anchor_ = X_BH;
  anchor_time_ = now;
  offset_sum_ = {};
  offset_count_ = 0;
}

/// Returns how long the handle has been still, and sums its poses for the mean.
double Homing::time_still_s(const Pose& X_BH, TimePoint now) noexcept {
  const PoseOffset offset = anchor_ ? offset_between(X_BH, *anchor_) : PoseOffset{};
  if (!anchor_ ||
      !(offset.position_m.norm() <= kStillTolerance_m && offset.rotation_rad.norm() <= kStillTolerance_rad)) {
    set_anchor(X_BH, now);
    offset_count_ = 1;
    return 0.0;
  }
  offset_sum_.position_m += offset.position_m;
  offset_sum_.rotation_rad += offset.rotation_rad;
  ++offset_count_;
  return seconds(now - anchor_time_);
}

}  // namespace wrenchd
