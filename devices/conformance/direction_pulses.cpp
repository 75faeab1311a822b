// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/conformance/direction_pulses.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include <spdlog/fmt/fmt.h>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// Least and largest number of pulses along an axis.
constexpr int kMinPulses = 3, kMaxPulses = 6;
/// Share of the profile's limits that a pulse may have.
constexpr double kPulseShare = 0.05;
/// A response is significant if it exceeds this multiple of its standard error.
constexpr double kSignificance = 5.0;
/// The pulses stop if the handle moves by more than this in one half.
constexpr double kMaxPulseTravel_m = 0.02, kMaxPulseTurn_rad = 0.3;
/// Time with the motors on before the first pulse along an axis.
constexpr Duration kMotorsOn = 30ms;
/// Two couplings of a symmetric response differ by at most this share of the larger one.
constexpr double kMaxAsymmetry = 0.5;

const char* axis_name(int axis) {
  return kAxisNames[static_cast<std::size_t>(axis)];
}

bool has_axis(DofMask axes, int axis) {
  return (axes >> axis & 1) != 0;
}

void append(std::string& list, const std::string& part) {
  if (!list.empty()) list += "; ";
  list += part;
}

}  // namespace

double pulse_force_N(const DeviceProfile& profile) noexcept {
  return std::min(kMaxPulse_N, kPulseShare * profile.max_force_N);
}

double pulse_torque_Nm(const DeviceProfile& profile) noexcept {
  return std::min(kMaxPulse_Nm, kPulseShare * profile.max_torque_Nm);
}

void DirectionPulses::Response::average(const std::vector<Vector3d>& moved) {
  const auto n = static_cast<double>(moved.size());
  mean.setZero();
  for (const Vector3d& m : moved) mean += m / n;
  Vector3d squares = Vector3d::Zero();
  for (const Vector3d& m : moved) squares += (m - mean).cwiseAbs2();
  error = (squares / (n * std::max(n - 1.0, 1.0))).cwiseSqrt();
}

bool DirectionPulses::Response::is_significant(int axis) const {
  return pulses >= kMinPulses && !stopped &&
         std::abs(mean[axis]) > std::max(kSignificance * error[axis], least);
}

int DirectionPulses::Response::strongest_axis() const {
  int strongest = 0;
  mean.cwiseAbs().maxCoeff(&strongest);
  return strongest;
}

std::string DirectionPulses::Response::text(int axis) const {
  return fmt::format("{}: {:+.3f} {}", axis_name(axis), 1e3 * mean[axis], force ? "mm" : "mrad");
}

RuleFinding DirectionPulses::judge_force(double pulse_N, DofMask axes, double least_m) {
  return judge(true, pulse_N, axes & kLinearDofs, least_m);
}

RuleFinding DirectionPulses::judge_torque(double pulse_Nm, DofMask axes, double least_rad) {
  return judge(false, pulse_Nm, static_cast<DofMask>((axes & kAngularDofs) >> 3), least_rad);
}

/// axes: bits 0 to 2 for x y z.
RuleFinding DirectionPulses::judge(bool force, double size, DofMask axes, double least) {
  Responses responses;
  for (int axis = 0; axis < 3; ++axis)
    if (has_axis(axes, axis)) responses[static_cast<std::size_t>(axis)] = apply(force, axis, size, least);
  std::string wrong, right, unclear;
  for (int axis = 0; axis < 3; ++axis) {
    if (!has_axis(axes, axis)) continue;
    const Response& r = responses[static_cast<std::size_t>(axis)];
    const std::string error = error_of(responses, axes, axis);
    if (!error.empty())
      append(wrong, error);
    else if (r.is_significant(axis))
      append(right, r.text(axis));
    else
      unclear += fmt::format(" {}{}", axis_name(axis), r.stopped ? " (the handle moved too far)" : "");
  }
  if (!wrong.empty()) return {Judgement::fail, wrong};
  if (!unclear.empty())
    return {Judgement::not_judged,
            "the motion does not show the direction of" + unclear + "; hold the handle still and loosely"};
  return {Judgement::pass, right};
}

std::string DirectionPulses::error_of(const Responses& responses, DofMask axes, int axis) {
  const Response& r = responses[static_cast<std::size_t>(axis)];
  const int strongest = r.strongest_axis();
  if (r.is_significant(axis) && r.mean[axis] < 0.0 && strongest == axis)
    return r.text(axis) + ", the sign is inverted";
  if (r.is_significant(strongest) && strongest != axis && !is_coupling(responses, axes, axis, strongest))
    return fmt::format("{} moves the handle along {}", axis_name(axis), axis_name(strongest));
  return {};
}

/// Returns true if the stronger motion along another axis is that of an arm with unequal masses:
///
///   A_ss A_aa > A_sa A_as > 0,   A_sa = A_as
bool DirectionPulses::is_coupling(const Responses& responses, DofMask axes, int axis, int strongest) {
  const Response& a = responses[static_cast<std::size_t>(axis)];
  if (!a.is_significant(axis) || a.mean[axis] < 0.0) return false;
  if (!has_axis(axes, strongest)) return true;
  const Response& s = responses[static_cast<std::size_t>(strongest)];
  const double A_sa = a.mean[strongest], A_as = s.mean[axis];
  return s.mean[strongest] * a.mean[axis] > A_sa * A_as &&
         std::abs(A_sa - A_as) < kMaxAsymmetry * std::max(std::abs(A_sa), std::abs(A_as));
}

/// Applies pulses of both signs in turn.
DirectionPulses::Response DirectionPulses::apply(bool force, int axis, double size, double least) {
  Wrench F;
  (force ? F.force_N : F.torque_Nm)[axis] = size;
  Response response;
  response.force = force;
  response.least = least;
  std::vector<Vector3d> moved;
  drive(kMotorsOn, {});
  // Half a pulse before the first one, so that every pulse begins with the motion of the one before it.
  drive(pace_.pulse / 2, -1.0 * F);
  const double too_far = force ? kMaxPulseTravel_m : kMaxPulseTurn_rad;
  while (response.pulses < kMaxPulses && !response.stopped) {
    const Vector3d up = displacement(force, F), down = displacement(force, -1.0 * F);
    ++response.pulses;
    response.stopped = up.norm() > too_far || down.norm() > too_far;
    if (response.stopped) break;
    moved.push_back(0.5 * (up - down));
    response.average(moved);
    if (response.pulses >= pace_.pulses && response.is_significant(response.strongest_axis())) break;
  }
  drive(pace_.after_axis, {});
  return response;
}

std::vector<MotionSample> DirectionPulses::drive(Duration time, const Wrench& F) {
  std::vector<MotionSample> samples = device_.drive(time, F);
  if (!samples.empty()) X_BH_ = samples.back().X_BH;
  return samples;
}

Vector3d DirectionPulses::displacement(bool force, const Wrench& F) {
  const std::optional<Pose> start = X_BH_;
  const std::vector<MotionSample> samples = drive(pace_.pulse, F);
  if (!start || samples.empty())
    throw std::runtime_error("the device stopped sending valid reports; check its power and its main loop");
  motion_.insert(motion_.end(), samples.begin(), samples.end());
  return force ? Vector3d(X_BH_->translation_m - start->translation_m)
               : turn_between(start->rotation, X_BH_->rotation);
}

}  // namespace wrenchd
