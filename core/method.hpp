// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// Method that computes the closest admissible configuration.
enum class Method : std::uint8_t {
  exact,    ///< all contacts together, no discretization (core/projection.hpp)
  planar,   ///< the paper's family of planes, contact by contact (core/planar_family.hpp)
  descent,  ///< the paper's numerical reference (core/descent.hpp)
  /// the traditional penalty method: translation only (core/METHOD.md, section 7.5; paper, section 4)
  translational,
};

}  // namespace wrenchd
