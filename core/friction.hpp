// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/contact.hpp"
#include "core/inertia.hpp"
#include "core/pose.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// [rendering.friction]: Coulomb's coefficients. 0 <= dynamic <= static; both zero: no friction.
struct FrictionSettings {
  static constexpr double kMaxCoefficient = 5.0;  ///< far beyond rubber on rubber

  double static_coefficient = 0.0;   ///< of a tool that has stuck for a while
  double dynamic_coefficient = 0.0;  ///< of a tool that slides

  bool enabled() const noexcept { return static_coefficient > 0.0 || dynamic_coefficient > 0.0; }
};

/// Coulomb friction as the proxy's resistance to sliding.
///
/// Under the contacts that touched at last tick's q, and no others, the closest configuration to p is q*; its
/// multipliers N_i are what presses there. Between the two lies q_0: as near to p as the tool comes
/// while the points of it that carry at q* stay where they were. (A tool that stands on a face stays as it
/// is; one that stands on its tip may turn about the tip.) Points slide on the way from q_0 to q* only, and
/// along it, with s from 0 to 1,
///
///   drawn  = (1 - s) sum f_i . slid_i       f_i: what holds point i at q_0 against p, within the ground
///   D      = s D* + (1 - s) D_0             D = sum N_i |slid_i|, with what presses at q* and at q_0
///
/// since nothing draws at q*, a minimum under its contacts. Forces are in the unit of dT. What presses at q_0
/// is another load, where friction has tilted the tool. Coulomb's law is drawn = mu D, so
///
///   1 - s = mu D* / (sum f_i . slid_i + mu (D* - D_0))
///
/// unless mu D_0 is as much as draws at q_0: then the tool sticks there. For q_s on that way there is a p'
/// that q_s is the closest configuration to, with what presses there for multipliers: p moved by friction.
/// The proxy follows p' instead of p, without friction, in the whole scene. What it meets on the way stops it
/// there, and rubs from the next tick on.
///
/// All memory is in the object. One object serves one thread.
class Friction {
 public:
  /// clearance_m: what the contacts are held open by, as in ExactProjection.
  Friction(const Inertia& M, const FrictionSettings& settings, double clearance_m);

  /// p': where the proxy is to follow to. X_WP itself where nothing rubs. X_WP: p; X_last: last tick's q.
  /// Once a tick. may_hold: whether it may be told to stay by holds(). RT safe.
  Pose frictional_goal(const Pose& X_WP, const Pose& X_last, bool may_hold = true) noexcept;

  /// Before that, where obstacles move: motion_of(k) is by how much obstacle number k has moved in the world
  /// since the last tick, X_WO now = motion * X_WO then. What rubbed goes with it, and the tool with what
  /// presses most. Answers where that takes it, the X_last for felt(). RT safe.
  template <class MotionOf>
  Pose carry_with_obstacle(const Pose& X_last, const MotionOf& motion_of) noexcept;

  /// Does the tool stick and cannot turn either? Then it stays at X_last to the bit, and held() says what of
  /// it: energy, contacts and multipliers for p. RT safe.
  bool sticks() const noexcept { return sticks_; }
  const Projection& stuck_projection() const noexcept { return frictionless_; }

  /// The tick's answer: what touches there rubs at the next tick. A tool that comes through the air is not
  /// held back where it came from. RT safe.
  void store_contacts(const Projection& answer) noexcept;

  void reset() noexcept;  ///< RT safe

 private:
  /// A contact of q*, and the point of the tool that is there.
  struct FrictionPoint {
    Contact contact;
    Vector3d p_TC_m;                       ///< the point
    Vector3d p_WC_m;                       ///< where it was at X_last
    Vector3d n_W;                          ///< at q*
    Eigen::Matrix<double, 3, 6> jacobian;  ///< its displacement, by a displacement y of the body at q*
    double gap_m;                          ///< at q*
    double multiplier;                     ///< zero where it touches idly [kg m]
    Vector3d slip_W_m;                     ///< tangential displacement of the point from X_last to q*
  };

  void collect_points(const Pose& X_last) noexcept;
  Pose stick_pose(const Pose& X_last) const noexcept;
  Vector3d stick_error_m(const FrictionPoint& touch, const Pose& X_WT) const noexcept;
  double stick_fraction(double mu, const Pose& X_WP, const Pose& X_stuck) noexcept;
  Vector3d rotational_gradient(const Quaterniond& E) const noexcept;
  double normal_multiplier(std::size_t i, double held) const noexcept;
  Pose goal_for_pose(const Pose& X_WQ, double held) const noexcept;

  Inertia M_;
  Matrix3d H_inverse_;
  Matrix3d rotation_scale_;  ///< of the last half of y: the turn in T [rad]
  FrictionSettings settings_;
  ExactProjection projection_;
  StaticVector<ActiveContact, ContactSet::kCapacity> last_contacts_;  ///< what touched at last tick's answer
  std::optional<Pose> X_WQ_last_;                                     ///< that answer
  Projection frictionless_;                                           ///< q*
  StaticVector<FrictionPoint, ContactSet::kCapacity> points_;
  std::array<double, ContactSet::kCapacity>
      multiplier_increase_;  ///< that each carries at q_0 than at q* [kg m]
  bool sticks_ = false;
  int ticks_stuck_ = 0;
};

template <class MotionOf>
Pose Friction::carry_with_obstacle(const Pose& X_last, const MotionOf& motion_of) noexcept {
  if (!X_WQ_last_ || last_contacts_.empty() || !same_bits(*X_WQ_last_, X_last)) return X_last;
  const auto pressing = [&](std::uint32_t obstacle) {
    double sum = 0.0;
    for (const ActiveContact& touch : last_contacts_)
      if (touch.contact.obstacle == obstacle) sum += touch.multiplier;
    return sum;
  };
  std::uint32_t carrier = last_contacts_[0].contact.obstacle;
  StaticVector<ActiveContact, ContactSet::kCapacity> now;
  for (const auto& [contact, multiplier] : last_contacts_) {
    if (pressing(contact.obstacle) > pressing(carrier)) carrier = contact.obstacle;
    now.add({moved(contact, motion_of(contact.obstacle)), multiplier});
  }
  last_contacts_ = now;
  X_WQ_last_ = motion_of(carrier) * X_last;
  X_WQ_last_->rotation.normalize();
  return *X_WQ_last_;
}

}  // namespace wrenchd
