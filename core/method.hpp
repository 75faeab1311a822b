// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// How the closest admissible configuration is found.
enum class Method : std::uint8_t {
  exact,          ///< all contacts together, no discretisation (core/projection.hpp)
  planar,         ///< the paper's family of planes, contact by contact (core/planar_family.hpp)
  descent,        ///< the paper's numerical reference (core/descent.hpp)
  translational,  ///< the traditional penalty method of section 4: translation only
};

}  // namespace wrenchd
