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
  require(plan.max_turn_rad >= plan.travel_rad, "max_turn_rad must be larger than travel_rad");
  require(plan.most_offset_m >= 0.0 && plan.most_offset_rad >= 0.0,
          "the offsets allowed must not be negative");
  require(is_finite(plan.X_BR) && std::abs(plan.X_BR.rotation.norm() - 1.0) < 1e-6,
          "the pose of the rest must be a pose");
}

std::string sentence_of(const HomingState& state) {
  const std::string axis = state.axis < kAxes ? kNames[state.axis] : "";
  switch (state.trouble) {
    case HomingTrouble::none:
      return "";
    case HomingTrouble::device_fault:
      return "The device: " + std::string(fault_row(state.fault).sentence) + " ";
    case HomingTrouble::not_in_rest:
      return "The handle is too far from its rest, or the device counts from somewhere else. ";
    case HomingTrouble::not_still:
      return "The handle still moves. ";
    case HomingTrouble::wrong_axis:
      return std::string("That moved ") + kNames[state.moved_axis] + ", not " + axis + ". ";
    case HomingTrouble::wrong_direction:
      return "That moved " + axis + " the other way. ";
    case HomingTrouble::velocity_disagrees:
      return "The velocity that the device reports along " + axis + " has another sign than its motion. ";
    case HomingTrouble::outside_workspace:
      return "The pose is outside of the workspace in " + axis + ", where the handle cannot be. ";
    case HomingTrouble::stored_offset_wrong:
      return "The stored calibration is farther off than the profile believes. ";
  }
  return "";
}

/// What to do when homing has failed of this.
const char* cure_of(HomingTrouble trouble) {
  switch (trouble) {
    case HomingTrouble::wrong_axis:
      return "Axes are exchanged: look at their order in the profile, and at the encoders' plugs.";
    case HomingTrouble::wrong_direction:
      return "Its sign is wrong: look at it in the profile, and at the encoder's plug.";
    case HomingTrouble::velocity_disagrees:
      return "Look at the sign of the velocity's step in the profile, or leave the velocity out.";
    case HomingTrouble::outside_workspace:
      return "Calibrate the device, and look at the steps and the workspace in the profile.";
    case HomingTrouble::stored_offset_wrong:
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

std::string told(const HomingState& state) {
  const std::string trouble = sentence_of(state);
  switch (state.step) {
    case HomingStep::listening:
      return trouble + "Waiting for the device to report.";
    case HomingStep::reference:
      return trouble + "Put the handle into its rest, let go of it, and confirm.";
    case HomingStep::settling:
      return trouble + "Hold the handle still.";
    case HomingStep::moving:
      return trouble + kAsk[std::min(state.axis, kAxes - 1)];
    case HomingStep::done:
      return "Homed: the device may be armed.";
    case HomingStep::failed:
      return "Homing failed. " + trouble + cure_of(state.trouble);
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
  offset_ = has_stored_ && plan_.reference != ReferenceUse::each_start ? stored_ : PoseOffset{};
  confirmed_ = false;
  erred_ = false;
  anchor_.reset();
  before_.reset();
}

const HomingState& Homing::advance(const DeviceSample& sample, TimePoint now) noexcept {
  if (sample.fault == Fault::device_lost) restart();
  if (state_.step == HomingStep::done || state_.step == HomingStep::failed) return state_;
  if (sample.fault != Fault::none) {
    state_.trouble = HomingTrouble::device_fault;
    state_.fault = sample.fault;
    if (state_.step == HomingStep::moving) state_.step = HomingStep::settling;
    anchor_.reset();
    return state_;
  }
  if (!sample.fresh) return state_;
  if (state_.trouble == HomingTrouble::device_fault) state_.trouble = HomingTrouble::none;
  state_.fault = Fault::none;

  if (state_.step == HomingStep::listening) start();
  if (state_.step == HomingStep::reference) {
    take_reference(sample, now);
    return state_;
  }
  const Pose X_BH = corrected(sample.X_BH, offset_);
  if (state_.step == HomingStep::failed || !within_workspace(X_BH)) return state_;
  if (state_.step == HomingStep::moving)
    move(sample, X_BH);
  else
    settle(X_BH, now);
  return state_;
}

void Homing::start() noexcept {
  const bool shown =
      plan_.reference == ReferenceUse::each_start || (plan_.reference == ReferenceUse::once && !has_stored_);
  if (shown) {
    state_.step = HomingStep::reference;
    return;
  }
  const bool believable = offset_.position_m.norm() <= plan_.most_offset_m &&
                          offset_.rotation_rad.norm() <= plan_.most_offset_rad;
  if (has_stored_ && !believable) return fail(HomingTrouble::stored_offset_wrong, 0);
  state_.axis = 0;
  next_axis();
}

/// From the one in the state on; behind the last, settling leads to done.
void Homing::next_axis() noexcept {
  while (state_.axis < kAxes && !plan_.sensed[state_.axis]) ++state_.axis;
  state_.step = HomingStep::settling;
  state_.trouble = HomingTrouble::none;
  state_.progress = 0.0;
  erred_ = false;
  anchor_.reset();
}

void Homing::take_reference(const DeviceSample& sample, TimePoint now) noexcept {
  if ((sample.buttons & plan_.confirm_buttons) != 0) confirmed_ = true;
  const double still_s = still_for_s(sample.X_BH, now);
  state_.progress = std::min(still_s / kRestFor_s, 1.0);
  if (!confirmed_) return;
  if (still_s < kRestFor_s) {
    state_.trouble = HomingTrouble::not_still;
    return;
  }
  const double share = 1.0 / static_cast<double>(count_);
  const Pose mean{anchor_->rotation * rotation_from(share * sum_.rotation_rad),
                  anchor_->translation_m + share * sum_.position_m};
  const PoseOffset found = offset_between(mean, plan_.X_BR);
  confirmed_ = false;
  if (!(found.position_m.norm() <= plan_.most_offset_m &&
        found.rotation_rad.norm() <= plan_.most_offset_rad)) {
    state_.trouble = HomingTrouble::not_in_rest;
    return;
  }
  offset_ = found;
  state_.axis = 0;
  next_axis();
}

void Homing::settle(const Pose& X_BH, TimePoint now) noexcept {
  const double still_s = still_for_s(X_BH, now);
  state_.progress = std::min(still_s / kStillFor_s, 1.0);
  if (still_s < kStillFor_s) return;
  if (state_.axis == kAxes) {
    state_ = {};
    state_.step = HomingStep::done;
    return;
  }
  state_.step = HomingStep::moving;
  state_.progress = 0.0;
  anchor(X_BH, now);
  before_.reset();
  agreed_ = disagreed_ = 0;
}

/// The first axis of its kind that went far enough decides which one was moved.
void Homing::move(const DeviceSample& sample, const Pose& X_BH) noexcept {
  compare_velocity(sample, X_BH);
  const bool turn = state_.axis >= 3;
  const double enough = turn ? plan_.travel_rad : plan_.travel_m;
  const Vector6d way = way_between(*anchor_, X_BH);
  state_.progress = std::clamp(way[static_cast<Eigen::Index>(state_.axis)] / enough, 0.0, 1.0);
  Eigen::Index moved = 0;
  const double farthest = way.segment<3>(turn ? 3 : 0).cwiseAbs().maxCoeff(&moved);
  if (turn) moved += 3;
  if (farthest >= enough) end_of_axis(static_cast<std::size_t>(moved), way[moved] > 0.0);
}

/// Zero velocities are those of a device that reports none.
void Homing::compare_velocity(const DeviceSample& sample, const Pose& X_BH) noexcept {
  const double passed_s = sample.device_time_s - before_s_;
  if (before_ && passed_s > 0.0) {
    Vector6d V;
    V << sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s;
    const auto axis = static_cast<Eigen::Index>(state_.axis);
    const double least = state_.axis < 3 ? kMoving_m_per_s : kMoving_rad_per_s;
    const double differenced = way_between(*before_, X_BH)[axis] / passed_s;
    if (std::abs(V[axis]) > least && std::abs(differenced) > least)
      ++((V[axis] > 0.0) == (differenced > 0.0) ? agreed_ : disagreed_);
  }
  before_ = X_BH;
  before_s_ = sample.device_time_s;
}

void Homing::end_of_axis(std::size_t moved, bool forward) noexcept {
  if (moved == state_.axis && forward) {
    if (disagreed_ >= kEnoughVelocities && disagreed_ > agreed_)
      return fail(HomingTrouble::velocity_disagrees, moved);
    ++state_.axis;
    return next_axis();
  }
  const HomingTrouble trouble =
      moved == state_.axis ? HomingTrouble::wrong_direction : HomingTrouble::wrong_axis;
  state_.moved_axis = moved;
  if (erred_) return fail(trouble, state_.axis);
  erred_ = true;
  state_.trouble = trouble;
  state_.step = HomingStep::settling;
  state_.progress = 0.0;
  anchor_.reset();
}

/// Fails where it is not. What is not a number is nowhere.
bool Homing::within_workspace(const Pose& X_BH) noexcept {
  const Vector3d& p = X_BH.translation_m;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (p[i] >= plan_.workspace_min_m[i] && p[i] <= plan_.workspace_max_m[i]) continue;
    fail(HomingTrouble::outside_workspace, static_cast<std::size_t>(i));
    return false;
  }
  const Vector3d turn = rotation_vector(X_BH.rotation);
  if (turn.norm() <= plan_.max_turn_rad) return true;
  Eigen::Index most = 0;
  turn.cwiseAbs().maxCoeff(&most);
  fail(HomingTrouble::outside_workspace, 3 + static_cast<std::size_t>(most));
  return false;
}

void Homing::fail(HomingTrouble trouble, std::size_t axis) noexcept {
  state_.step = HomingStep::failed;
  state_.trouble = trouble;
  state_.axis = axis;
  state_.progress = 0.0;
}

void Homing::anchor(const Pose& X_BH, TimePoint now) noexcept {
  anchor_ = X_BH;
  anchored_ = now;
  sum_ = {};
  count_ = 0;
}

/// How long the handle has been where it is; the mean of its poses since then is kept.
double Homing::still_for_s(const Pose& X_BH, TimePoint now) noexcept {
  const PoseOffset away = anchor_ ? offset_between(X_BH, *anchor_) : PoseOffset{};
  if (!anchor_ || !(away.position_m.norm() <= kStill_m && away.rotation_rad.norm() <= kStill_rad)) {
    anchor(X_BH, now);
    count_ = 1;
    return 0.0;
  }
  sum_.position_m += away.position_m;
  sum_.rotation_rad += away.rotation_rad;
  ++count_;
  return seconds(now - anchored_);
}

}  // namespace wrenchd
