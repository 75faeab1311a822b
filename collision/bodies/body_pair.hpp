// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "collision/half_space_contacts.hpp"
#include "collision/mesh_contacts.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Two poses of a body: at the start and at the end of a tick.
struct BodyPath {
  Pose start, end;
};

/// Upper bound on the displacement of a point of a body of this radius [m], METHOD (92). RT-safe.
double displacement_bound_m(const BodyPath& path, double radius_m) noexcept;

/// The pose at a fraction of the straight path between two poses. RT-safe.
inline Pose between(const Pose& from, const Pose& to, double fraction) noexcept {
  return {from.rotation.slerp(fraction, to.rotation),
          from.translation_m + fraction * (to.translation_m - from.translation_m)};
}

/// A pair of bodies of a BodyWorld, or a body and all fixed obstacles, and the sweep between them. Body a is
/// the tool of the sweep and body b its obstacle, so the sweep runs in the frame of b. core/METHOD.md,
/// section 15.4.
class BodyPair {
 public:
  static constexpr std::size_t kFixed = SIZE_MAX;

  /// scene: body a as the tool; body b at the identity, or the fixed obstacles if b is kFixed. Not RT-safe:
  /// allocates.
  BodyPair(std::size_t a, std::size_t b, Scene scene);

  std::size_t a() const noexcept { return a_; }
  std::size_t b() const noexcept { return b_; }
  const Scene& scene() const noexcept { return scene_; }
  bool is_fixed() const noexcept { return b_ == kFixed; }

  /// Returns false if no contact is possible on the paths, from bounding spheres. RT-safe.
  bool is_near(const BodyPath& path_a, const BodyPath& path_b) const noexcept;

  struct SweepTimes {
    double start_s = 0.0, end_s = 0.0;  ///< scene time of the fixed obstacles [s]
  };
  /// Finds the contacts that the bodies meet on the way from their start to their end poses. path_b: unused
  /// if b is kFixed. RT-safe.
  SweepQuery::SweepResult sweep(const BodyPath& path_a, const BodyPath& path_b, double clearance_m,
                                VisitBudget& budget, const SweepTimes& times) noexcept;
  /// Adds the contacts with half-spaces whose gap at the end is below the clearance. RT-safe.
  void add_half_spaces(const Pose& X_WA, double clearance_m, ContactSet& contacts) const noexcept;
  /// True if the features of a contact face each other at the end of the last sweep, to the clearance.
  /// RT-safe.
  bool touches(const Contact& contact) const noexcept;
  /// The contacts with meshes whose gap at the end of the last sweep is at most its clearance. RT-safe.
  const ContactSet& touching() const noexcept { return contacts_.touching(); }
  /// Prepares the sweeps of the next tick. X_next: expected end poses. RT-safe.
  void prefetch(const BodyPath& path_a, const BodyPath& path_b, double time_s, VisitBudget& budget) noexcept;
  /// Forgets what was prepared, after a body was placed elsewhere. RT-safe.
  void reset() noexcept { contacts_.reset(); }

 private:
  Pose in_b(const Pose& X_WA, const Pose& X_WB) const noexcept;

  std::size_t a_, b_;
  Scene scene_;
  HalfSpaceContacts half_spaces_;
  MeshContacts contacts_;
};

}  // namespace wrenchd
