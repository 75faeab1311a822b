// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// What detects contacts between meshes.
enum class ContactBackend : std::uint8_t {
  native,  ///< wrenchd's BVH and kernels (collision/mesh_contacts.hpp): RT-safe
  /// CGAL's AABB trees and exact predicates (collision/cgal/cgal_contacts.hpp): the reference. Not RT-safe.
  cgal,
};

}  // namespace wrenchd
