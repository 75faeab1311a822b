// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "collision/feasible_pose_search.hpp"
#include "collision/proxy.hpp"
#include "collision/scene_contacts.hpp"
#include "core/contact.hpp"
#include "core/descent.hpp"
#include "core/friction.hpp"
#include "core/method.hpp"
#include "core/planar_family.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The generalized penetration depth of one configuration p.
struct Penetration {
  Projection projection;            ///< q, T and the contacts. q = p where p is admissible.
  std::uint16_t contacts = 0;       ///< feature pairs that touch at q; 0 where p is admissible
  Vector6d eps = Vector6d::Zero();  ///< Eq. (15): exponential coordinates of p^-1 q
  /// What enters the wrench law. The same as eps for exact. For planar too, unless several contacts need each
  /// its own projection: then the sum of their eps, as section 5 of the paper adds their wrenches. For
  /// translational, [d; sum (c_i - x) x d_i]: with the force gain k for both halves this is the force k d at
  /// each contact and its torque about the centre of mass, which is that method's wrench.
  Vector6d spring_displacement = Vector6d::Zero();
};

/// Computes the generalized penetration depth of a scene's tool by the method chosen. All memory is taken at
/// construction.
class PenetrationDepth {
 public:
  struct Options {
    Method method = Method::exact;
    int planes = 47;  ///< N_delta for planar; 47 is the paper's
    /// How far contacts are held open [m]: zero for the exact optimum, Proxy::kClearance_m for a proxy that
    /// is to be admissible to the last digit. A scene of meshes always keeps the latter.
    double clearance_m = 0.0;
    FrictionSettings friction = {};  ///< of a proxy that is followed; only exact knows it
  };

  /// The scene is kept by reference and must outlive this. Throws std::invalid_argument where the method
  /// cannot work with the scene, or has no friction: only exact knows bodies that are not convex, and rubs.
  PenetrationDepth(const Scene& scene, Options options);
  PenetrationDepth(const PenetrationDepth&) = delete;
  PenetrationDepth& operator=(const PenetrationDepth&) = delete;

  /// Follows a proxy: X_last is last tick's q, an admissible pose. Where no admissible pose is found near p
  /// the proxy stays there, and draws the hand back to where it came from. With friction q lags behind the
  /// optimum for p: it is that for p moved by friction (core/friction.hpp), and so are multipliers and
  /// kkt_residual; energy and eps are those between p and q. scene_time_s: at which the obstacles stand [s];
  /// where they move it never runs back, and X_last was admissible at that of the last follow(), query() or
  /// forget(). RT safe.
  Penetration follow(const Pose& X_WP, const Pose& X_last, double scene_time_s = 0.0) noexcept;
  /// Knows no history; exact seeks the global optimum, among meshes the nearest of several local ones.
  /// Neither allocates nor locks, but is up to a thousand times dearer, among meshes more: no work for the
  /// servo thread. Once stop is asked for, it ends within a few milliseconds; its answer is worth nothing
  /// then. scene_time_s: at which the obstacles stand [s].
  Penetration query(const Pose& X_WP, const std::stop_token& stop = {}, double scene_time_s = 0.0) noexcept;

  /// Forgets what the last answers were held by: the next pose to follow from is none of them. It is one that
  /// was admissible when the obstacles stood as at scene_time_s [s]. RT safe.
  void clear_history(double scene_time_s = 0.0) noexcept;

  /// Whether contacts with mesh obstacles number the features of the meshes, or those of their hulls.
  bool uses_mesh_features() const noexcept { return proxy_.has_value(); }

 private:
  Penetration follow_frictionless(const Pose& X_WP, const Pose& X_last, double scene_time_s) noexcept;
  Penetration follow_exactly(const Pose& X_WP, const Pose& X_last) noexcept;
  Penetration follow_with_friction(const Pose& X_WP, const Pose& X_last, double scene_time_s) noexcept;
  static Penetration to_penetration(const Pose& X_WP, const Projection& projection) noexcept;
  template <class Solve>
  void refine_planes(Projection& best, const Solve& solve) noexcept;
  Projection project_globally(const Pose& X_WP, const std::stop_token& stop) noexcept;
  Projection translate(const Pose& X_WP) noexcept;
  Penetration approximate(const Pose& X_WP, const Pose& X_start) noexcept;
  Penetration descend(const Pose& X_WP, const Pose& X_start) noexcept;
  Penetration planar(const Pose& X_WP) noexcept;
  Penetration translational(const Pose& X_WP) noexcept;

  Options options_;
  const Scene& bodies_;
  Inertia M_;
  SceneContacts scene_contacts_;
  ExactProjection exact_;
  Descent descent_;  ///< works with exact_
  PlanarFamily planar_;
  ContactSet contacts_;  ///< what planar works through
  StaticVector<ActiveContact, ContactSet::kCapacity>
      warm_start_;                                 ///< what carried at the last answer of follow()
  std::optional<Pose> X_last_answer_;              ///< that answer: the planes held admit it
  std::vector<SeparatingPlane> saved_planes_;      ///< while other planes are tried
  std::vector<SeparatingPlane> best_planes_;       ///< of the best answer so far
  std::optional<Friction> friction_;               ///< where there is any
  std::optional<Proxy> proxy_;                     ///< where there are meshes
  std::optional<FeasiblePoseSearch> pose_search_;  ///< likewise
};

}  // namespace wrenchd
