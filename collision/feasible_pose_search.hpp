// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <stop_token>

#include "collision/overlap_test.hpp"
#include "collision/proxy.hpp"
#include "collision/scene.hpp"
#include "core/contact_backend.hpp"

namespace wrenchd {

/// Finds an admissible pose where no previous proxy pose exists: at the start, and after a change of the tool
/// or of an obstacle (core/METHOD.md, section 14.7).
///
/// The search samples poses around p at increasing distance. From each sample without overlap a proxy
/// approaches p. The search returns the proxy pose with the least distance to p. This pose is admissible and
/// a local optimum. It is probably the nearest admissible pose, but this is not proven.
///
/// The object keeps a reference to the scene, which must outlive it. Not RT-safe: may take milliseconds, and
/// seconds deep inside a fine mesh.
class FeasiblePoseSearch {
 public:
  explicit FeasiblePoseSearch(const Scene& scene, ContactBackend contacts = ContactBackend::native);

  /// Returns true if the tool overlaps no obstacle at X_WT and lies outside every solid. time_s: scene time
  /// of the obstacle poses [s]. Not RT-safe: may take milliseconds.
  bool admissible(const Pose& X_WT, double time_s = 0.0) noexcept;

  /// Returns the admissible pose nearest to X_WP with its contacts. Returns status infeasible if no pose was
  /// found. After a stop request the search returns its best result so far within a few milliseconds: after
  /// at most one admissibility test or one proxy tick. time_s: as in admissible(). Not RT-safe: may take
  /// seconds.
  Projection nearest(const Pose& X_WP, const std::stop_token& stop = {}, double time_s = 0.0) noexcept;

 private:
  Projection converge_proxy(const Pose& X_WP, const Pose& X_start, const std::stop_token& stop,
                            double time_s) noexcept;

  const Scene& scene_;
  HalfSpaceContacts half_spaces_;
  std::unique_ptr<OverlapTest> overlap_test_;
  Proxy proxy_;
};

}  // namespace wrenchd
