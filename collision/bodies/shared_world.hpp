// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <optional>

#include "collision/bodies/body_world.hpp"
#include "core/scene_settings.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Poses of the bodies of a scene, in their order; the tool of a second hand is the last one.
using BodyPoses = StaticVector<Pose, SceneSettings::kMaxBodies>;

/// A BodyWorld that knows the time up to which its bodies have moved. The proxies of all hands in it share
/// one object. Each tick of a hand moves the world on, for the time since the last tick of any hand. Time is
/// scene time.
///
/// The constructor allocates all memory; all other members are RT-safe. One thread uses an object.
class SharedWorld {
 public:
  /// Bounds of the time that passes for the bodies in one step [s]. After a longer step the bodies have lost
  /// time.
  static constexpr double kMinStep_s = 1e-5;
  static constexpr double kMaxStep_s = 5e-3;

  /// Where a tool without a hand is in lists of poses: so far below the world's origin that no search for an
  /// admissible pose meets it [m].
  static constexpr double kFarBelow_m = 1e3;

  /// Copies what it needs of the scene. If the last body of the scene is of_hand, the world has two tools.
  /// Not RT-safe: allocates.
  SharedWorld(const Scene& scene, double tool_friction, const GraspStrength& grasp);

  /// Returns the time that passes for the bodies until scene time time_s [s], from now on the time of the
  /// last step.
  double advance_to(double time_s) noexcept;
  /// Takes over the motions of another object of the same bodies.
  void adopt(const SharedWorld& other) noexcept;
  /// Puts all free bodies back to their start, at scene time time_s [s].
  void restart(double time_s) noexcept;
  /// The poses of all bodies but one tool. A tool without a hand is far away.
  BodyPoses poses_without(std::size_t tool) const noexcept;

  BodyWorld& world() noexcept { return world_; }
  const BodyWorld& world() const noexcept { return world_; }

 private:
  BodyWorld world_;
  StaticVector<BodyMotion, SceneSettings::kMaxBodies> starts_;
  std::optional<double> last_time_s_;  ///< scene time of the last step; empty before the first one
};

/// The tool of one hand in a world that several hands share.
struct SharedTool {
  std::shared_ptr<SharedWorld> world;  ///< null: the hand has a world of its own
  std::size_t tool = 0;
};

}  // namespace wrenchd
