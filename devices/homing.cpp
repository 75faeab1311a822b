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

/// The positive direction of each axis, as one would say it to the person who holds the handle.
constexpr std::array<const char*, kAxes> kAsk = {
    "Push the handle straight away from you.",
    "Move the handle straight to the left.",
    "Lift the handle straight up.",
    "Tip the top of the handle to the right.",
    "Tip the top of the handle away from you.",
    "Turn the handle to the left, counterclockwise as seen from above.",
};

/// Slower than this, sign and velocity are matters of noise and of the firmware's filter.
constexpr double kMoving_m_per_s = 0.01;
constexpr double kMoving_rad_per_s = 0.1;
constexpr int kEnoughVelocities = 3;

/// Way from one pose to another: along and about the axes of the base.
Vector6d way_between(const Pose& from, const Pose& to) noexcept {
  Vector6d way;
  way << to.translation_m - from.translation_m, rotation_vector(to.rotation * from.rotation.conjugate());
  return way;
}

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(std::string("homing plan: ") + what);
}

void check(const HomingPlan& plan) {
  require(std::any_of(plan.sensed.begin(), plan.sensed.end(), [](bool s) { return s; }),
          "no axis is sensed, so there is nothing to home");
  require(plan.travel_m > 0.0 && plan.travel_m <= 0.5, "travel_m must be above 0 and 0.5 at most");
  require(plan.travel_rad > 0.0 && plan.travel_rad <= 1.5, "travel_rad must be above 0 and 1.5 at most");
  for (int i = 0; i < 3; ++i)
    require(plan.workspace_max_m[i] - plan.workspace_min_m[i] >= plan.travel_m,
            "the workspace must be larger than the way that the handle is to be moved");
  require(plan.max_rotation_rad >= plan.travel_rad, "max_turn_rad must be larger than travel_rad");
  require(plan.max_offset_m >= 0.0 && plan.max_offset_rad >= 0.0, "the offsets allowed must not be negative");
  require(is_finite(plan.X_BR) && std::abs(plan.X_BR.rotation.norm() - 1.0) < 1e-6,
          "the pose of the rest must be a pose");
}

std::string sentence_of(const HomingState& state) {
  const std::string axis = state.axis < kAxes ? kNames[state.axis] : "";
  switch (state.problem) {
    case HomingProblem::none:
      return "";
    case HomingProblem::device_fault:
      return "The device: " + std::string(fault_row(state.fault).message) + " ";
    case HomingProblem::not_at_reference:
      return "The handle is too far from its rest, or the device counts from somewhere else. ";
    case HomingProblem::not_still:
      return "The handle still moves. ";
    case HomingProblem::wrong_axis:
      return std::string("That moved ") + kNames[state.moved_axis] + ", not " + axis + ". ";
    case HomingProblem::wrong_direction:
      return "That moved " + axis + " the other way. ";
    case HomingProblem::velocity_sign_mismatch:
      return "The velocity that the device reports along " + axis + " has another sign than its motion. ";
    case HomingProblem::outside_workspace:
      return "The pose is outside of the workspace in " + axis + ", where the handle cannot be. ";
    case HomingProblem::stored_offset_too_large:
      return "The stored calibration is farther off than the profile believes. ";
  }
  return "";
}

/// What to do when homing has failed of this.
const char* cure_of(HomingProblem trouble) {
  switch (trouble) {
    case HomingProblem::wrong_axis:
      return "Axes are exchanged: look at their order in the profile, and at the encoders' plugs.";
    case HomingProblem::wrong_direction:
      return "Its sign is wrong: look at it in the profile, and at the encoder's plug.";
    case HomingProblem::velocity_sign_mismatch:
      return "Look at the sign of the velocity's step in the profile, or leave the velocity out.";
    case HomingProblem::outside_workspace:
      return "Calibrate the device, and look at the steps and the workspace in the profile.";
    case HomingProblem::stored_offset_too_large:
      return "Calibrate the device again.";
    default:
      return "Begin again.";
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
    const auto* const found = std::find(kNames.begin(), kNames.end(), offset.axis);
    if (found == kNames.end()) return {};
    const auto i = found - kNames.begin();
    (i < 3 ? pose.position_m : pose.rotation_rad)[i % 3] = offset.offset;
  }
  return pose;
}

std::string operator_instruction(const HomingState& state) {
  const std::string trouble = sentence_of(state);
  switch (state.step) {
    case HomingStep::awaiting_sample:
      return trouble + "Waiting for the device to report.";
    case HomingStep::reference:
      return trouble + "Put the handle into its rest, let go of it, and confirm.";
    case HomingStep::holding_still:
      return trouble + "Hold the handle still.";
    case HomingStep::moving:
      return trouble + kAsk[std::min(state.axis, kAxes - 1)];
    case HomingStep::done:
      return "Homed: the device may be armed.";
    case HomingStep::failed:
      return "Homing failed. " + trouble + cure_of(state.problem);
  }
  return "";
}

Homing::Homing(const HomingPlan& plan) : plan_(plan) {
  check(plan);
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
  const bool shown = plan_.reference == ReferenceSchedule::each_start ||
                     (plan_.reference == ReferenceSchedule::once && !has_stored_);
  if (shown) {
    state_.step = HomingStep::reference;
    return;
  }
  const bool believable =
      offset_.position_m.norm() <= plan_.max_offset_m && offset_.rotation_rad.norm() <= plan_.max_offset_rad;
  if (has_stored_ && !believable) return fail(HomingProblem::stored_offset_too_large, 0);
  state_.axis = 0;
  next_axis();
}

/// From the one in the state on; behind the last, settling leads to done.
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
  const PoseOffset found = offset_between(mean, plan_.X_BR);
  reference_confirmed_ = false;
  if (!(found.position_m.norm() <= plan_.max_offset_m && found.rotation_rad.norm() <= plan_.max_offset_rad)) {
    state_.problem = HomingProblem::not_at_reference;
    return;
  }
  offset_ = found;
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

/// The first axis of its kind that went far enough decides which one was moved.
void Homing::track_motion(const DeviceSample& sample, const Pose& X_BH) noexcept {
  compare_velocity(sample, X_BH);
  const bool turn = state_.axis >= 3;
  const double enough = turn ? plan_.travel_rad : plan_.travel_m;
  const Vector6d way = way_between(*anchor_, X_BH);
  state_.progress = std::clamp(way[static_cast<Eigen::Index>(state_.axis)] / enough, 0.0, 1.0);
  Eigen::Index moved = 0;
  const double farthest = way.segment<3>(turn ? 3 : 0).cwiseAbs().maxCoeff(&moved);
  if (turn) moved += 3;
  if (farthest >= enough) finish_axis(static_cast<std::size_t>(moved), way[moved] > 0.0);
}

/// Zero velocities are those of a device that reports none.
void Homing::compare_velocity(const DeviceSample& sample, const Pose& X_BH) noexcept {
  const double passed_s = sample.device_time_s - previous_time_s_;
  if (previous_pose_ && passed_s > 0.0) {
    Vector6d V;
    V << sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s;
    const auto axis = static_cast<Eigen::Index>(state_.axis);
    const double least = state_.axis < 3 ? kMoving_m_per_s : kMoving_rad_per_s;
    const double differenced = way_between(*previous_pose_, X_BH)[axis] / passed_s;
    if (std::abs(V[axis]) > least && std::abs(differenced) > least)
      ++((V[axis] > 0.0) == (differenced > 0.0) ? velocity_matches_ : velocity_mismatches_);
  }
  previous_pose_ = X_BH;
  previous_time_s_ = sample.device_time_s;
}

void Homing::finish_axis(std::size_t moved, bool forward) noexcept {
  if (moved == state_.axis && forward) {
    if (velocity_mismatches_ >= kEnoughVelocities && velocity_mismatches_ > velocity_matches_)
      return fail(HomingProblem::velocity_sign_mismatch, moved);
    ++state_.axis;
    return next_axis();
  }
  const HomingProblem trouble =
      moved == state_.axis ? HomingProblem::wrong_direction : HomingProblem::wrong_axis;
  state_.moved_axis = moved;
  if (axis_retried_) return fail(trouble, state_.axis);
  axis_retried_ = true;
  state_.problem = trouble;
  state_.step = HomingStep::holding_still;
  state_.progress = 0.0;
  anchor_.reset();
}

/// Fails where it is not. What is not a number is nowhere.
bool Homing::within_workspace(const Pose& X_BH) noexcept {
  const Vector3d& p = X_BH.translation_m;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (p[i] >= plan_.workspace_min_m[i] && p[i] <= plan_.workspace_max_m[i]) continue;
    fail(HomingProblem::outside_workspace, static_cast<std::size_t>(i));
    return false;
  }
  const Vector3d turn = rotation_vector(X_BH.rotation);
  if (turn.norm() <= plan_.max_rotation_rad) return true;
  Eigen::Index most = 0;
  turn.cwiseAbs().maxCoeff(&most);
  fail(HomingProblem::outside_workspace, 3 + static_cast<std::size_t>(most));
  return false;
}

void Homing::fail(HomingProblem trouble, std::size_t axis) noexcept {
  state_.step = HomingStep::failed;
  state_.problem = trouble;
  state_.axis = axis;
  state_.progress = 0.0;
}

void Homing::set_anchor(const Pose& X_BH, TimePoint now) noexcept {
  anchor_ = X_BH;
  anchor_time_ = now;
  offset_sum_ = {};
  offset_count_ = 0;
}

/// How long the handle has been where it is; the mean of its poses since then is kept.
double Homing::time_still_s(const Pose& X_BH, TimePoint now) noexcept {
  const PoseOffset away = anchor_ ? offset_between(X_BH, *anchor_) : PoseOffset{};
  if (!anchor_ ||
      !(away.position_m.norm() <= kStillTolerance_m && away.rotation_rad.norm() <= kStillTolerance_rad)) {
    set_anchor(X_BH, now);
    offset_count_ = 1;
    return 0.0;
  }
  offset_sum_.position_m += away.position_m;
  offset_sum_.rotation_rad += away.rotation_rad;
  ++offset_count_;
  return seconds(now - anchor_time_);
}

}  // namespace wrenchd
