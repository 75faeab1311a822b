// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "collision/bodies/shared_world.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "collision/touch.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// The proxy of one hand in a scene with free bodies or a second hand: tools and bodies move together
/// (BodyWorld), and the answer is what the tool's proxy is in a scene without bodies. Time is scene time.
///
/// The constructors allocate all memory; all other members are RT-safe. One thread uses all proxies of a
/// world.
class BodyProxy {
 public:
  /// The only hand in a world of its own. Copies what it needs of the scene. Not RT-safe: allocates.
  BodyProxy(const Scene& scene, double tool_friction, const GraspStrength& grasp = {});
  /// The hand that leads this tool of the world. scene: as this hand sees the world, with its own tool.
  BodyProxy(std::shared_ptr<SharedWorld> shared, std::size_t tool, const Scene& scene);

  /// Moves the bodies to scene time time_s [s] while no proxy follows the hand: the tool is out of the world.
  void move_without_tool(double time_s) noexcept;
  /// True if another hand leads a tool in the same world.
  bool shares_world() const noexcept { return world_.tool_count() > 1; }
  /// Takes the tool out of the world until enter(). It lets go.
  void leave() noexcept { world_.remove_tool(tool_); }
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
  std::size_t held_body() const noexcept { return world_.held_body(tool_); }
  /// True if the last follow() ended a grasp whose load was larger than its strength.
  bool grasp_broke() const noexcept { return world_.grasp_broke(tool_); }
  /// Repeats the last follow() or move_tool() for another pose of the hand.
  Penetration follow_again(const Pose& X_WP) noexcept;

  /// Change of T of Eq. (8) that bodies and moving obstacles caused in the last follow() [kg m^2].
  double work_kg_m2() const noexcept;
  /// The contacts that hold the tool after the last follow(). Bodies are numbered after the obstacles.
  Touches touches() const noexcept;
  BodyPoses poses() const noexcept { return shared_->poses_without(tool_); }
  double time_s() const noexcept { return world_.time_s(); }

  /// Takes over the motions of another object of the same bodies.
  void adopt(const BodyProxy& other) noexcept { shared_->adopt(*other.shared_); }
  /// Puts all bodies back to their start, at scene time time_s [s].
  void restart(double time_s) noexcept { shared_->restart(time_s); }

 private:
  bool concerns_tool(const BodyContact& contact) const noexcept {
    return contact.a == body_ || contact.b == body_;
  }
  Touch touch_of(const BodyContact& contact) const noexcept;
  Penetration answer(BodyWorld::Status status) const noexcept;

  std::shared_ptr<SharedWorld> shared_;
  BodyWorld& world_;
  std::size_t tool_, body_;  ///< number of the tool in the world, and of the body that it is
  Inertia M_;
  std::uint32_t first_body_;           ///< obstacle number of the first body
  BodyWorld::Hand hand_;               ///< of the last follow() or move_tool()
  bool grasp_wanted_ = false;          ///< the last set_grasp()
  double dt_s_ = 0.0, until_s_ = 0.0;  ///< of the last follow() or move_tool()
};

}  // namespace wrenchd
