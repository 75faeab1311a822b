// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "core/pose.hpp"
#include "tools/import/import_file.hpp"
#include "tools/import/imported_body.hpp"

namespace wrenchd {

/// A body with its pose. M: frame of its mesh.
struct PlacedBody {
  std::string name;
  ImportedBody body;
  Pose X_WM;
};

/// How to import a robot.
struct RobotJob {
  ImportJob job;                      ///< file, links as parts, chord error
  std::vector<std::string> joints;    ///< "NAME=VALUE"
  std::vector<std::string> packages;  ///< "NAME=DIR"
  Joining joining;
};

/// Imports the collision elements of a URDF file as bodies in the frame of its root link. Meshes lie beneath
/// the directory of the file, or beneath a package. remarks: receives what was left out. Throws ImportError,
/// without the name of the file. Not RT-safe: may take minutes.
std::vector<PlacedBody> import_robot(const RobotJob& job, std::vector<std::string>& remarks);

/// Returns the collision elements of a URDF file. Throws ImportError. Not RT-safe.
std::vector<PartSummary> list_links(const RobotJob& job);

}  // namespace wrenchd
