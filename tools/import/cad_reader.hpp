// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include <TopoDS_Solid.hxx>

namespace wrenchd {

enum class CadFormat { step, brep };

/// A part of a CAD file: one instance in its assembly, in the frame of the file, in millimetres.
struct CadPart {
  std::string name;  ///< unique in the file: "bolt", "bolt#2"
  std::vector<TopoDS_Solid> solids;
  std::size_t free_faces = 0;   ///< faces that bound no solid
  std::string free_face_place;  ///< place of the first one
};

struct CadModel {
  std::string unit;  ///< "inch"; several units in one file: "inch, millimetre"
  std::vector<CadPart> parts;
  std::vector<std::string> remarks;
};

/// How to read a CAD file.
struct CadReading {
  CadFormat format = CadFormat::step;
  double unit_mm = 0.0;  ///< unit of a file that states none; 0: such a file is rejected
};

/// Reads all parts of a CAD file. OpenCASCADE converts STEP to millimetres. Throws ImportError. For the child
/// process only. Not RT-safe: allocates, may take minutes.
CadModel read_cad(const std::string& bytes, const CadReading& reading);

/// Leaves the parts with these names; an empty list selects all. "bolt" also selects "bolt#2". Rejects a name
/// that no part has, parts without solids, and faces that bound no solid unless skip_surfaces is true. Throws
/// ImportError. Not RT-safe: allocates.
void select_parts(CadModel& model, const std::vector<std::string>& names, bool skip_surfaces);

/// Repairs and checks a solid. Returns the valid solid, oriented outward; adds what was changed to remarks.
/// part: for messages. Throws ImportError that names the face, the defect and the remedy. Not RT-safe.
TopoDS_Solid checked_solid(const TopoDS_Solid& solid, const std::string& part,
                           std::vector<std::string>& remarks);

}  // namespace wrenchd
