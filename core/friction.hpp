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

/// [rendering.friction]: Coulomb coefficients, 0 <= dynamic <= static. Both zero: no friction.
struct FrictionSettings {
  /// upper limit of a coefficient, far above rubber on rubber
  static constexpr double kMaxCoefficient = 5.0;

  double static_coefficient = 0.0;   ///< coefficient while the tool sticks (after 20 ticks at rest)
  double dynamic_coefficient = 0.0;  ///< coefficient while the tool slides

  bool enabled() const noexcept { return static_coefficient > 0.0 || dynamic_coefficient > 0.0; }
};

/// Coulomb friction of the proxy (core/METHOD.md, section 9). Every tick it moves the goal p to a frictional
/// goal p', METHOD (76); the proxy then follows p' without friction in the whole scene.
///
/// q* is the closest configuration to p under the contacts that touched at the previous q. q_0 is the stuck
/// pose: as near to p as the tool comes while its loaded contact points keep their positions. Coulomb's law,
/// METHOD (74), selects the pose q_s on the segment from q_0 to q*; METHOD (75) gives the fraction 1 - s. p'
/// is the goal whose closest configuration is q_s. A new contact acts from the next tick on.
///
/// All memory is in the object. One object serves one thread.
class Friction {
 public:
  /// clearance_m: gap at which the projection holds contacts, as in ExactProjection. Not RT-safe: set-up.
  Friction(const Inertia& M, const FrictionSettings& settings, double clearance_m);

  /// The frictional goal p' in W; X_WP itself if no contact carries load. X_WP: p. X_last: q of the previous
  /// tick. may_stick: if false, sticks() remains false. Call once per tick. RT-safe.
  Pose frictional_goal(const Pose& X_WP, const Pose& X_last, bool may_stick = true) noexcept;

  /// Call before frictional_goal() if obstacles move. motion_of(k): displacement of obstacle k in W since the
  /// previous tick, X_WO(now) = motion * X_WO(before). Moves the stored contacts with their obstacles, and
  /// the tool with the obstacle that carries the largest load. Returns the moved tool pose: X_last for
  /// frictional_goal(). RT-safe, if motion_of is.
  template <class MotionOf>
  Pose carry_with_obstacle(const Pose& X_last, const MotionOf& motion_of) noexcept;

  /// True if the tool sticks and cannot rotate. Then it stays at X_last bit for bit, and stuck_projection()
  /// has the energy, contacts and multipliers for p. RT-safe.
  bool sticks() const noexcept { return sticks_; }
  const Projection& stuck_projection() const noexcept { return frictionless_; }

  /// Stores the contacts of the tick's projection; they cause friction from the next tick on. A contact that
  /// is new in this tick does not pull the tool back to an earlier pose. RT-safe.
  void store_contacts(const Projection& answer) noexcept;

  void reset() noexcept;  ///< Discards all stored contacts. RT-safe.

 private:
  /// A contact at q* and the tool point at which it acts.
  struct FrictionPoint {
    Contact contact;
    Vector3d p_TC_m;  ///< tool point in T [m]
    Vector3d p_WC_m;  ///< position of the tool point at X_last, in W [m]
    Vector3d n_W;     ///< contact normal at q*, in W
    /// displacement of the point for a displacement y of the body at q*, METHOD (72)
    Eigen::Matrix<double, 3, 6> jacobian;
    double gap_m;       ///< gap at q* [m]
    double multiplier;  ///< contact multiplier at q*; zero for a contact without load [kg m]
    Vector3d slip_W_m;  ///< tangential displacement of the point from X_last to q*, in W [m]
  };

  void collect_points(const Pose& X_last) noexcept;
  Pose stick_pose(const Pose& X_last) const noexcept;
  Vector3d stick_error_m(const FrictionPoint& point, const Pose& X_WT) const noexcept;
  double stick_fraction(double mu, const Pose& X_WP, const Pose& X_stuck) noexcept;
  Vector3d rotational_gradient(const Quaterniond& E) const noexcept;
  double normal_multiplier(std::size_t i, double fraction) const noexcept;
  Pose goal_for_pose(const Pose& X_WQ, double fraction) const noexcept;

  Inertia M_;
  Matrix3d H_inverse_;
  Matrix3d rotation_scale_;  ///< rotation in T [rad] for the last three components of y
  FrictionSettings settings_;
  ExactProjection projection_;
  /// contacts that touched at the previous projection
  StaticVector<ActiveContact, ContactSet::kCapacity> last_contacts_;
  std::optional<Pose> X_WQ_last_;  ///< pose of the previous projection
  Projection frictionless_;        ///< q*: projection of p without friction
  StaticVector<FrictionPoint, ContactSet::kCapacity> points_;
  std::array<double, ContactSet::kCapacity>
      multiplier_increase_;  ///< increase of each multiplier from q* to q_0 [kg m]
  bool sticks_ = false;
  int ticks_stuck_ = 0;
};

template <class MotionOf>
Pose Friction::carry_with_obstacle(const Pose& X_last, const MotionOf& motion_of) noexcept {
  if (!X_WQ_last_ || last_contacts_.empty() || !same_bits(*X_WQ_last_, X_last)) return X_last;
  const auto load_on = [&](std::uint32_t obstacle) {
    double sum = 0.0;
    for (const ActiveContact& active : last_contacts_)
      if (active.contact.obstacle == obstacle) sum += active.multiplier;
    return sum;
  };
  std::uint32_t carrier = last_contacts_[0].contact.obstacle;
  StaticVector<ActiveContact, ContactSet::kCapacity> now;
  for (const auto& [contact, multiplier] : last_contacts_) {
    if (load_on(contact.obstacle) > load_on(carrier)) carrier = contact.obstacle;
    now.add({moved(contact, motion_of(contact.obstacle)), multiplier});
  }
  last_contacts_ = now;
  X_WQ_last_ = motion_of(carrier) * X_last;
  X_WQ_last_->rotation.normalize();
  return *X_WQ_last_;
}

}  // namespace wrenchd
