// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include <TopLoc_Location.hxx>
#include <TopoDS_Shape.hxx>

namespace wrenchd::test {

/// A named part of an assembly.
struct SamplePart {
  std::string name;
  TopoDS_Shape shape;
  TopLoc_Location place = {};
};

/// Returns the STEP file of a shape whose numbers are in millimetres. unit: "MM", "INCH", "M": the unit of
/// the file.
std::string step_of(const TopoDS_Shape& shape, const char* unit = "MM");
/// Returns the STEP file of an assembly.
std::string step_of(const std::vector<SamplePart>& parts);
/// Returns the BREP file of a shape.
std::string brep_of(const TopoDS_Shape& shape);

/// A location without rotation [mm].
TopLoc_Location at(double x, double y, double z);
/// A location turned about z [rad] and moved [mm].
TopLoc_Location turned_at(double angle, double x, double y, double z);

/// A plate of 60 x 40 x 10 mm with its corner at the origin and a hole of radius 8 mm along z in its centre.
TopoDS_Shape plate_with_hole();

}  // namespace wrenchd::test
