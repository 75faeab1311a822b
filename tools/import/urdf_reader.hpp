// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// Shape of a collision element of a URDF link. Its frame S has the unit of the mesh file, or metres.
struct UrdfShape {
  enum class Kind : int { mesh, box, cylinder, sphere };
  std::string link;
  std::string name;  ///< unique in the robot: "arm", "arm-2"
  Kind kind = Kind::mesh;
  std::string mesh;                    ///< name of the mesh file as the URDF gives it
  Vector3d scale = Vector3d::Ones();   ///< factors of the mesh along its own axes
  Vector3d size_m = Vector3d::Zero();  ///< box: sides; cylinder: radius, length; sphere: radius
  Pose X_WS;                           ///< W: frame of the root link
};

/// A robot with fixed joint positions.
struct UrdfRobot {
  std::string name;
  std::vector<UrdfShape> shapes;
  std::vector<std::string> remarks;
};

/// Reads a URDF file. joints: position of each named joint in rad or m; other joints are at 0, and mimic
/// joints follow theirs. Throws ImportError that names the line or the link and the remedy. Not RT-safe:
/// allocates.
UrdfRobot read_urdf(const std::string& bytes, const std::map<std::string, double>& joints);

/// Returns the bytes of the robot, for a pipe between two processes of this program. Not RT-safe: allocates.
std::string packed(const UrdfRobot& robot);
/// Reads such bytes. Returns false if they are incomplete. Not RT-safe: allocates.
bool unpack(const std::string& bytes, UrdfRobot& robot);

}  // namespace wrenchd
