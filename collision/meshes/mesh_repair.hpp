// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd {

/// Repairs what needs no guess about the shape. The repair moves no point by more than the rounding of single
/// precision. It fills no hole and does not separate intersecting parts. It does the following:
///
/// - Removes unused points and merges equal points.
/// - Removes repeated corners, and faces with fewer than three corners.
/// - Removes faces without area until none is left. A corner on a side of another face becomes a corner of
/// that
///   face.
/// - Keeps one of several equal faces. Removes both of two opposite faces where that leaves fewer open edges:
/// the
///   wall between two solids that touch.
/// - Closes cracks that are no wider than rounding: merges the points along them.
/// - Flips faces whose orientation differs from the majority of their shell.
/// - Flips shells that face inwards and lie in no other shell, together with their contents.
/// - Splits points and edges in which parts of the surface are only joined: a point with several fans of
/// faces,
///   an edge with four faces or more that bound wedges of a solid. The parts then touch each other there.
///
/// Returns one sentence for each kind of repair with the number and the first place. Does nothing if a number
/// or an index is invalid. Not RT-safe: allocates, may take seconds.
std::vector<std::string> repair(PolygonSoup& soup);

}  // namespace wrenchd
