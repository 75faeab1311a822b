// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/cad_primitive.hpp"

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <TopoDS.hxx>
#include <gp_Ax2.hxx>

namespace wrenchd {
namespace {

TopoDS_Shape primitive_shape(Primitive kind, const Vector3d& size) {
  switch (kind) {
    case Primitive::box:
      return BRepPrimAPI_MakeBox(gp_Pnt(-size.x() / 2, -size.y() / 2, -size.z() / 2), size.x(), size.y(),
                                 size.z())
          .Shape();
    case Primitive::cylinder:
      return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, -size.y() / 2), gp_Dir(0, 0, 1)), size.x(),
                                      size.y())
          .Shape();
    case Primitive::sphere:
      break;
  }
  return BRepPrimAPI_MakeSphere(size.x()).Shape();
}

}  // namespace

CadModel primitive_model(Primitive kind, const Vector3d& size_mm, const std::string& name) {
  CadModel model;
  model.unit = "mm";
  CadPart& part = model.parts.emplace_back();
  part.name = name;
  part.solids.push_back(TopoDS::Solid(primitive_shape(kind, size_mm)));
  return model;
}

}  // namespace wrenchd
