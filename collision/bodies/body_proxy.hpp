// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "collision/bodies/body_world.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "collision/touch.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Poses of the bodies of a scene, in their order.
using BodyPoses = StaticVector<Pose, SceneSettings::kMaxBodies>;

/// The proxy in a scene with free bodies: tool and bodies move together (BodyWorld), and the answer is what
/// the tool's proxy is in a scene without bodies. Time is scene time.
///
/// The constructor allocates all memory; all other members are RT-safe. One object serves one thread.
class BodyProxy {
 public:
  /// Bounds of the time that passes for the bodies in one tick [s]. After a longer tick the bodies have lost
  /// time.
  static constexpr double kMinStep_s = 1e-5;
  static constexpr double kMaxStep_s = 5e-3;

  /// Copies what it needs of the scene. Not RT-safe: allocates.
  BodyProxy(const Scene& scene, double tool_friction, const GraspStrength& grasp = {});

  /// Moves the bodies to scene time time_s [s] while no proxy follows the hand.
  void move_without_tool(double time_s) noexcept;
  /// Puts the tool at X_WQ, which was admissible with the bodies at `then` and the obstacles at then_s.
  /// Returns false, and leaves the tool out, if something may have moved into it since.
  bool enter(const Pose& X_WQ, const BodyPoses& then, double then_s) noexcept;
  /// Moves tool and bodies to scene time time_s [s]. stiffness_per_s2: k of the energy law.
  Penetration follow(const Pose& X_WP, double stiffness_per_s2, double time_s) noexcept;
  /// True if a proxy that knows the obstacles alone has the same answer as follow(): the bodies sleep, and
  /// the tool cannot reach them.
  bool bodies_are_out_of_reach(const Pose& X_WP) const noexcept {
    return world_.bodies_are_out_of_reach(X_WP);
  }
  /// Replaces follow() if bodies_are_out_of_reach(): takes the tool pose X_WQ that this other proxy found.
  void move_tool(const Pose& X_WP, const Pose& X_WQ, double stiffness_per_s2, double time_s) noexcept;
  /// True if the last step was a move_tool().
  bool tool_was_moved() const noexcept { return world_.tool_was_moved(); }
  /// wanted: the tool holds the body that it touches, or the first one that it will touch; otherwise it lets
  /// go.
  void set_grasp(bool wanted) noexcept;
  /// The number of the body that the tool holds, from 1 in the order of the scene; 0: none.
  std::size_t held_body() const noexcept { return world_.held_body(); }
  /// True if the last follow() ended a grasp whose load was larger than its strength.
  bool grasp_broke() const noexcept { return world_.grasp_broke(); }
  /// Repeats the last follow() or move_tool() for another pose of the hand.
  Penetration follow_again(const Pose& X_WP) noexcept;

  /// Change of T of Eq. (8) that bodies and moving obstacles caused in the last follow() [kg m^2].
  double work_kg_m2() const noexcept;
  /// The contacts that hold the tool after the last follow(). Bodies are numbered after the obstacles.
  Touches touches() const noexcept;
  BodyPoses poses() const noexcept;
  double time_s() const noexcept { return world_.time_s(); }

  /// Takes over the motions of another object of the same bodies.
  void adopt(const BodyProxy& other) noexcept;
  /// Puts all bodies back to their start, at scene time time_s [s].
  void restart(double time_s) noexcept;

 private:
  double step_to(double time_s) noexcept;
  Touch touch_of(const BodyContact& contact) const noexcept;
  Penetration answer(BodyWorld::Status status) const noexcept;

  BodyWorld world_;
  Inertia M_;
  std::uint32_t first_body_;  ///< obstacle number of the first body
  StaticVector<BodyMotion, SceneSettings::kMaxBodies> starts_;
  std::optional<double> last_time_s_;  ///< scene time of the last step; empty before the first one
  BodyWorld::Hand hand_;               ///< of the last follow() or move_tool()
  bool grasp_wanted_ = false;          ///< the last set_grasp()
  double dt_s_ = 0.0, until_s_ = 0.0;  ///< of the last follow() or move_tool()
};

}  // namespace wrenchd
