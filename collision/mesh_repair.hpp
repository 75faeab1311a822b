// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/mesh_file.hpp"

namespace wrenchd {

/// Repairs what can be repaired without guessing at a shape: no point is moved by more than what single
/// precision rounds away, no hole is filled, nothing that cuts through itself is parted.
///
///   points that no face uses           left out
///   points at the same place           merged
///   corners given twice in a row       one of them left out; a face left with two is none
///   faces without area                 left out; a corner on another's side becomes a corner of that face
///   too faces given twice, either way up   one kept cracks no wider than rounding      closed: the points
///   along them are merged faces against their neighbours     turned as most of their shell are shells that
///   look inwards           turned, with all that is in them, where they are in no other shell
///
/// Returns a sentence for each kind of change: how many, and where the first was. None where nothing was
/// done, as with numbers or indices that are wrong. Not RT safe.
std::vector<std::string> repair(PolygonSoup& soup);

}  // namespace wrenchd
