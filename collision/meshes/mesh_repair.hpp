// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd {

/// Repairs what can be repaired without guessing at a shape: no point is moved by more than what single
/// precision rounds away, no hole is filled, nothing that cuts through itself is parted.
///
/// - Points that no face uses are left out, points at the same place merged.
/// - Of corners given twice in a row one is left out; a face left with two is none.
/// - Faces without area are left out; a corner on another's side becomes a corner of that face.
/// - Of faces given twice, either way up, one is kept.
/// - Cracks no wider than rounding are closed: the points along them are merged.
/// - Faces against their neighbours are turned as most of their shell are.
/// - Shells that look inwards are turned, with all that is in them, where they are in no other shell.
///
/// Returns a sentence for each kind of change: how many, and where the first was. None where nothing was
/// done, as with numbers or indices that are wrong. Not RT safe.
std::vector<std::string> repair(PolygonSoup& soup);

}  // namespace wrenchd
