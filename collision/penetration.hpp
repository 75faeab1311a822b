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
#include "core/contact_backend.hpp"
#include "core/descent.hpp"
#include "core/friction.hpp"
#include "core/method.hpp"
#include "core/planar_family.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The generalized penetration depth of one configuration p (core/METHOD.md, section 1.3).
struct Penetration {
  Projection projection;            ///< q, T and the contacts; q = p if p is admissible
  std::uint16_t contacts = 0;       ///< number of feature pairs that touch at q; 0 if p is admissible
  Vector6d eps = Vector6d::Zero();  ///< Eq. (15): exponential coordinates of p^-1 q
  /// The displacement that the wrench law multiplies with the stiffness.
  /// - exact, descent: equal to eps.
  /// - planar: equal to eps. If several contacts need one projection each, it is the sum of their eps
  ///   (core/METHOD.md, section 7.3; paper, section 5).
  /// - translational: METHOD (59), [d; sum (c_i - x) x d_i]. With one force gain k for both halves, this
  ///   yields the force k d at each contact and its torque about the centre of mass.
  Vector6d spring_displacement = Vector6d::Zero();
};

/// Computes the generalized penetration depth of a scene's tool by the chosen method. The constructor
/// allocates all memory. One object serves one thread.
class PenetrationDepth {
 public:
  struct Options {
    Method method = Method::exact;
    int planes = 47;  ///< number of planes N_delta of method planar; the paper uses 47
    /// The gap at which contacts are held open [m]. Zero yields the exact optimum. Proxy::kClearance_m yields
    /// a proxy that is admissible to the last digit. A scene of meshes always uses Proxy::kClearance_m.
    double clearance_m = 0.0;
    FrictionSettings friction = {};    ///< friction of a followed proxy; method exact only
    Proxy::WorkLimit work_limit = {};  ///< work limit of one tick of a followed proxy
    /// What detects contacts between meshes. With ContactBackend::cgal no member is RT-safe.
    ContactBackend contacts = ContactBackend::native;
  };

  /// Keeps a reference to the scene, which must outlive this object. Throws std::invalid_argument if the
  /// method does not support the scene or friction. Only method exact supports bodies that are not convex,
  /// and friction. Not RT-safe: allocates.
  PenetrationDepth(const Scene& scene, Options options);
  PenetrationDepth(const PenetrationDepth&) = delete;
  PenetrationDepth& operator=(const PenetrationDepth&) = delete;

  /// Follows a proxy and returns its new pose q for the commanded pose X_WP. X_last: q of the previous tick,
  /// an admissible pose. If no admissible pose exists near p, the proxy stays at X_last and pulls the hand
  /// back.
  ///
  /// With friction q is the optimum for the frictional goal (core/METHOD.md, section 9.3). Multipliers and
  /// kkt_residual then belong to that goal; energy and eps are between p and q. scene_time_s: scene time of
  /// the obstacle poses [s]. If obstacles move, it must not decrease, and X_last must be admissible at the
  /// time of the previous follow(), query() or clear_history(). RT-safe.
  Penetration follow(const Pose& X_WP, const Pose& X_last, double scene_time_s = 0.0) noexcept;
  /// Returns the penetration depth of X_WP without history. Method exact searches the global optimum; among
  /// meshes it returns the nearest of several local optima. After a stop request it returns within a few
  /// milliseconds with an undefined result. scene_time_s: scene time of the obstacle poses [s]. Not RT-safe:
  /// neither allocates nor locks, but may take seconds among meshes.
  Penetration query(const Pose& X_WP, const std::stop_token& stop = {}, double scene_time_s = 0.0) noexcept;

  /// Clears the contacts of the last answers. The next X_last is a different pose that is admissible at
  /// scene_time_s [s]. RT-safe.
  void clear_history(double scene_time_s = 0.0) noexcept;

  /// Discards the contacts of the last follow(), whose answer is not the X_last of the next one. RT-safe.
  void discard_contacts() noexcept;

  /// Returns true if contacts with mesh obstacles number mesh features, false if they number features of the
  /// convex hulls. RT-safe.
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
  Descent descent_;  ///< uses exact_
  PlanarFamily planar_;
  ContactSet contacts_;                                            ///< contacts that method planar processes
  StaticVector<ActiveContact, ContactSet::kCapacity> warm_start_;  ///< loaded contacts of the last follow()
  std::optional<Pose> X_last_answer_;          ///< answer of the last follow(); the held planes admit it
  std::vector<SeparatingPlane> saved_planes_;  ///< held planes, saved while the search tries others
  std::vector<SeparatingPlane> best_planes_;   ///< held planes of the best answer so far
  std::vector<double> first_energies_;         ///< T of each alternative's first answer [kg m^2]
  std::optional<Friction> friction_;           ///< empty without friction
  std::optional<Proxy> proxy_;  ///< empty in scenes without meshes, and for all methods but exact
  /// empty if the scene has no mesh obstacles, or if all bodies are convex
  std::optional<FeasiblePoseSearch> pose_search_;
};

}  // namespace wrenchd
