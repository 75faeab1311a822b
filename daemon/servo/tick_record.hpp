// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "core/fault.hpp"

namespace wrenchd {

/// Inputs, results and outputs of one tick, as numbers and enumerations. A recording stores it, shared memory
/// shows it to other programs, a replay compares it.
///
/// daemon/servo/tick_fields.def lists the fields in order: type, name, initial value, unit, frame and
/// meaning. A pose is x y z [m], qx qy qz qw [-]. A wrench is fx fy fz [N], tx ty tz [N.m]. Frames:
/// core/README.md, section "Conventions".
struct TickRecord {
  using PoseNumbers = std::array<double, 7>;
  using BodyNumbers = std::array<double, 7 * 8>;  ///< Poses of 8 bodies.
  using Numbers6 = std::array<double, 6>;
  using StageNumbers = std::array<std::int64_t, 5>;

#define WRENCHD_TICK_FIELD(type, name, initial, unit, frame, values, meaning) type name = initial;
#include "daemon/servo/tick_fields.def"
#undef WRENCHD_TICK_FIELD
};

}  // namespace wrenchd
