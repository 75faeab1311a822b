// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "collision/cgal/cgal_contacts.hpp"
#include "collision/mesh_contacts.hpp"
#include "collision/proxy.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {

/// What a comparison of sweeps has seen.
struct SweepCounts {
  long sweeps = 0;
  long crossed = 0;                 ///< sweeps that met contacts
  long contacts = 0;                ///< contacts met
  long touching = 0;                ///< pairs of features that touch at the end of a path
  long overlaps = 0;                ///< sweeps whose path was too long
  long different = 0;               ///< sweeps with different results
  double largest_difference = 0.0;  ///< between the numbers of equal contacts [m, -]
  std::string first_difference;

  void add(const SweepCounts& other);
};

/// Runs the same sweeps with wrenchd's kernels and with CGAL's trees, and compares the features, their order
/// and the overlaps.
class SweepComparison {
 public:
  explicit SweepComparison(const Scene& scene) : native_(scene), cgal_(scene) {}

  /// start: an admissible pose.
  void compare(const Pose& X_start, const Pose& X_end);

  const SweepCounts& counts() const noexcept { return counts_; }

 private:
  void report(const std::string& what, const Pose& X_start, const Pose& X_end);

  MeshContacts native_;
  CgalContacts cgal_;
  SweepCounts counts_;
};

/// Lets a proxy follow the hand of a case for a number of ticks. From each of its poses, compares the sweep
/// to the hand, the sweep to its next pose, and `random_paths` sweeps of random length and direction.
SweepCounts compare_sweeps(const ManipulationCase& handling, int ticks, int random_paths, std::uint64_t seed);

}  // namespace wrenchd::test
