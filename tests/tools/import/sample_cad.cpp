// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/tools/import/sample_cad.hpp"

#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <STEPControl_Writer.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <gp_Ax2.hxx>

#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {
namespace {

std::string contents(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

std::string step_of(const TopoDS_Shape& shape, const char* unit) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  STEPControl_Writer writer;
  Interface_Static::SetCVal("write.step.unit", unit);
  // The writer states the unit, but writes the numbers of the shape as they are.
  const std::string name = unit;
  gp_Trsf to_unit;
  to_unit.SetScaleFactor(name == "INCH" ? 1.0 / 25.4 : name == "M" ? 1e-3 : 1.0);
  const TopoDS_Shape scaled = name == "MM" ? shape : BRepBuilderAPI_Transform(shape, to_unit, true).Shape();
  if (writer.Transfer(scaled, STEPControl_AsIs) != IFSelect_RetDone) throw std::runtime_error("no STEP");
  const TemporaryDirectory dir;
  const auto file = dir.path() / "a.step";
  if (writer.Write(file.c_str()) != IFSelect_RetDone) throw std::runtime_error("no STEP file");
  Interface_Static::SetCVal("write.step.unit", "MM");
  return contents(file);
}

std::string step_of(const std::vector<SamplePart>& parts) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  Handle(TDocStd_Document) document = new TDocStd_Document("XmlXCAF");
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const TDF_Label assembly = shapes->NewShape();
  TDataStd_Name::Set(assembly, "assembly");
  for (const SamplePart& part : parts) {
    const TDF_Label label = shapes->AddShape(part.shape, false);
    TDataStd_Name::Set(label, TCollection_ExtendedString(part.name.c_str(), true));
    shapes->AddComponent(assembly, label, part.place);
  }
  shapes->UpdateAssemblies();
  STEPCAFControl_Writer writer;
  Interface_Static::SetCVal("write.step.unit", "MM");
  if (!writer.Transfer(document)) throw std::runtime_error("no STEP");
  const TemporaryDirectory dir;
  const auto file = dir.path() / "a.step";
  if (writer.Write(file.c_str()) != IFSelect_RetDone) throw std::runtime_error("no STEP file");
  return contents(file);
}

std::string brep_of(const TopoDS_Shape& shape) {
  std::ostringstream out;
  BRepTools::Write(shape, out);
  return out.str();
}

TopLoc_Location at(double x, double y, double z) {
  gp_Trsf placed;
  placed.SetTranslation(gp_Vec(x, y, z));
  return placed;
}

TopLoc_Location turned_at(double angle, double x, double y, double z) {
  gp_Trsf turned;
  turned.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), angle);
  return at(x, y, z) * TopLoc_Location(turned);
}

TopoDS_Shape plate_with_hole() {
  const TopoDS_Shape plate = BRepPrimAPI_MakeBox(60.0, 40.0, 10.0).Shape();
  const TopoDS_Shape drill =
      BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(30, 20, -5), gp_Dir(0, 0, 1)), 8.0, 20.0).Shape();
  return BRepAlgoAPI_Cut(plate, drill).Shape();
}

}  // namespace wrenchd::test
