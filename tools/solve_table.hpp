// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <iosfwd>
#include <vector>

#include "collision/pose_solver.hpp"

namespace wrenchd {

/// Writes the rows as CSV with a header. Numbers have the shortest form that converts back to the same value.
/// proxy: adds columns for status and iterations before the last one, the KKT residual. Not RT-safe: writes
/// to a stream.
void write_csv(std::ostream& out, const std::vector<SolvedPose>& rows, bool proxy = false);

}  // namespace wrenchd
