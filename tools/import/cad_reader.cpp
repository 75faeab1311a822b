// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/cad_reader.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include <BRepBndLib.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepCheck.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepCheck_ListIteratorOfListOfStatus.hxx>
#include <BRepGProp.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <Bnd_Box.hxx>
#include <GProp_GProps.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_Printer.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <ShapeFix_Shape.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_SequenceOfAsciiString.hxx>
#include <TDF_Label.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>

#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

/// An assembly of assemblies multiplies its parts; a file of a few kilobytes could ask for billions.
constexpr std::size_t kMaxParts = 20'000;
constexpr int kMaxDepth = 100;

/// Keeps the messages of OpenCASCADE, which otherwise go to standard output.
class MessageCollector : public Message_Printer {
 public:
  DEFINE_STANDARD_RTTI_INLINE(MessageCollector, Message_Printer)

  /// Returns the first message of an error; empty if there is none.
  const std::string& first_error() const { return first_error_; }

 protected:
  void send(const TCollection_AsciiString& text, const Message_Gravity gravity) const override {
    if (gravity >= Message_Fail && first_error_.empty()) first_error_ = text.ToCString();
  }

 private:
  mutable std::string first_error_;
};

Handle(MessageCollector) collect_messages() {
  Handle(MessageCollector) collector = new MessageCollector();
  Message::DefaultMessenger()->ChangePrinters().Clear();
  Message::DefaultMessenger()->AddPrinter(collector);
  return collector;
}

/// Returns OpenCASCADE's reason as an addition to a message.
std::string reason_text(const Handle(MessageCollector) & messages) {
  std::string reason = messages->first_error();
  for (char& c : reason)
    if (c == '\n' || c == '\t') c = ' ';
  while (!reason.empty() && (reason.front() == ' ' || reason.front() == '*')) reason.erase(0, 1);
  while (!reason.empty() && reason.back() == ' ') reason.pop_back();
  return reason.empty() ? "" : " (" + printable_name(reason) + ")";
}

std::string centre_text(const TopoDS_Shape& shape) {
  Bnd_Box box;
  BRepBndLib::Add(shape, box, false);
  if (box.IsVoid()) return "an unknown place";
  double x0 = 0, y0 = 0, z0 = 0, x1 = 0, y1 = 0, z1 = 0;
  box.Get(x0, y0, z0, x1, y1, z1);
  return place_text(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1));
}

std::string name_of(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (!label.FindAttribute(TDataStd_Name::GetID(), name)) return {};
  const TCollection_ExtendedString& text = name->Get();
  std::string utf8(static_cast<std::size_t>(text.LengthOfCString()) + 1, '\0');
  Standard_PCharacter at = utf8.data();
  utf8.resize(static_cast<std::size_t>(text.ToUTF8CString(at)));
  return printable_name(utf8);
}

/// Walks the assemblies of a document.
class PartCollector {
 public:
  explicit PartCollector(CadModel& model) : model_(model) {}

  void collect(const TDF_Label& label, const TopLoc_Location& where, int depth = 0) {
    if (depth > kMaxDepth) throw ImportError("its assemblies are nested too deeply; export it again");
    if (!XCAFDoc_ShapeTool::IsAssembly(label)) {
      const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
      if (!shape.IsNull()) add(name_of(label), shape.Moved(where));
      return;
    }
    TDF_LabelSequence components;
    XCAFDoc_ShapeTool::GetComponents(label, components, false);
    for (const TDF_Label& component : components) {
      TDF_Label part;
      if (XCAFDoc_ShapeTool::GetReferredShape(component, part))
        collect(part, where * XCAFDoc_ShapeTool::GetLocation(component), depth + 1);
    }
  }

  void add(std::string name, const TopoDS_Shape& shape) {
    if (model_.parts.size() >= kMaxParts)
      throw ImportError("has more than " + std::to_string(kMaxParts) + " parts; export a smaller assembly");
    if (name.empty()) name = "part";
    const std::size_t number = ++count_[name];
    CadPart& part = model_.parts.emplace_back();
    part.name = number == 1 ? name : name + "#" + std::to_string(number);
    for (TopExp_Explorer at(shape, TopAbs_SOLID); at.More(); at.Next())
      part.solids.push_back(TopoDS::Solid(at.Current()));
    for (TopExp_Explorer at(shape, TopAbs_FACE, TopAbs_SOLID); at.More(); at.Next())
      if (++part.free_faces == 1) part.free_face_place = centre_text(at.Current());
    if (!part.solids.empty() || part.free_faces > 0) return;
    model_.remarks.push_back("part '" + part.name + "' has curves or points only; it is left out");
    model_.parts.pop_back();
  }

 private:
  CadModel& model_;
  std::map<std::string, std::size_t> count_;
};

/// Returns the units of a STEP file; empty if it states none.
std::string step_unit(STEPControl_Reader& reader) {
  TColStd_SequenceOfAsciiString lengths, angles, solid_angles;
  reader.FileUnits(lengths, angles, solid_angles);
  std::set<std::string> names;
  for (const TCollection_AsciiString& name : lengths) names.insert(printable_name(name.ToCString()));
  std::string text;
  for (std::string name : names) {
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

void read_step(const std::string& bytes, const CadReading& reading, CadModel& model) {
  if (bytes.find("ISO-10303-21") == std::string::npos)
    throw ImportError("is not a STEP file: it does not begin with ISO-10303-21; export it as STEP");
  const Handle(MessageCollector) messages = collect_messages();
  STEPCAFControl_Reader reader;
  reader.SetNameMode(true);
  reader.SetColorMode(false);
  reader.SetLayerMode(false);
  reader.SetPropsMode(false);
  reader.SetGDTMode(false);
  reader.SetMatMode(false);
  reader.SetViewMode(false);
  std::istringstream stream(bytes);
  if (reader.ChangeReader().ReadStream("model", stream) != IFSelect_RetDone)
    throw ImportError("is damaged or no STEP file" + reason_text(messages) + "; export it again");
  if (reader.NbRootsForTransfer() == 0) throw ImportError("contains no shape; export the solids as STEP");
  model.unit = step_unit(reader.ChangeReader());
  double scale = 1.0;
  if (model.unit.empty()) {
    if (reading.unit_mm == 0.0)
      throw ImportError("states no unit of length; give it with --unit, for example --unit mm");
    scale = reading.unit_mm;  // OpenCASCADE takes numbers without a unit as millimetres
  } else if (reading.unit_mm != 0.0) {
    throw ImportError("states its unit (" + model.unit + "); leave --unit out");
  }
  Handle(TDocStd_Document) document = new TDocStd_Document("XmlXCAF");
  if (!reader.Transfer(document))
    throw ImportError("its shapes cannot be read" + reason_text(messages) + "; export it again");
  if (reader.ExternFiles().Size() > 0)
    throw ImportError(
        "refers to other STEP files; export the assembly as one file, or import its parts one by one");
  TDF_LabelSequence roots;
  XCAFDoc_DocumentTool::ShapeTool(document->Main())->GetFreeShapes(roots);
  PartCollector collector(model);
  for (const TDF_Label& root : roots) collector.collect(root, TopLoc_Location());
  if (scale == 1.0) return;
  gp_Trsf scaling;
  scaling.SetScaleFactor(scale);
  for (CadPart& part : model.parts)
    for (TopoDS_Solid& solid : part.solids)
      solid = TopoDS::Solid(BRepBuilderAPI_Transform(solid, scaling, true).Shape());
}

void read_brep(const std::string& bytes, const CadReading& reading, CadModel& model) {
  const Handle(MessageCollector) messages = collect_messages();
  TopoDS_Shape shape;
  BRep_Builder builder;
  std::istringstream stream(bytes);
  BRepTools::Read(shape, stream, builder);
  if (shape.IsNull())
    throw ImportError("is damaged or no BREP file" + reason_text(messages) + "; export it again");
  if (reading.unit_mm == 0.0)
    throw ImportError("a BREP file states no unit of length; give it with --unit, for example --unit mm");
  if (reading.unit_mm != 1.0) {
    gp_Trsf scaling;
    scaling.SetScaleFactor(reading.unit_mm);
    shape = BRepBuilderAPI_Transform(shape, scaling, true).Shape();
  }
  PartCollector(model).add("part", shape);
}

/// Returns the number of a face in the order of the solid, from 1, and its place.
std::string face_text(const TopoDS_Shape& solid, const TopoDS_Shape& sub_shape) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(solid, TopAbs_FACE, faces);
  for (int i = 1; i <= faces.Extent(); ++i)
    for (TopExp_Explorer at(faces(i), sub_shape.ShapeType()); at.More(); at.Next())
      if (at.Current().IsSame(sub_shape))
        return "face " + std::to_string(i) + " near " + centre_text(sub_shape);
  return "near " + centre_text(sub_shape);
}

/// Returns the statuses of a shape that are errors, as words: "self intersecting wire".
std::string errors_of(const Handle(BRepCheck_Result) & result) {
  std::string text;
  for (BRepCheck_ListIteratorOfListOfStatus at(result->Status()); at.More(); at.Next()) {
    if (at.Value() == BRepCheck_NoError) continue;
    std::ostringstream name;
    BRepCheck::Print(at.Value(), name);
    std::string words;
    for (const char c : name.str().substr(0, name.str().find_last_not_of(" \n") + 1)) {
      if (std::isupper(static_cast<unsigned char>(c)) != 0 && !words.empty()) words += ' ';
      words += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    if (const auto prefix = words.find('_'); prefix != std::string::npos) words.erase(0, prefix + 1);
    while (!words.empty() && words.front() == ' ') words.erase(0, 1);
    text += (text.empty() ? "" : ", ") + words;
  }
  return text;
}

/// Returns the first defect of an invalid shape with its place.
std::string first_defect(const TopoDS_Shape& solid, const BRepCheck_Analyzer& analyzer) {
  for (const TopAbs_ShapeEnum kind : {TopAbs_FACE, TopAbs_WIRE, TopAbs_EDGE, TopAbs_VERTEX, TopAbs_SHELL}) {
    TopTools_IndexedMapOfShape shapes;
    TopExp::MapShapes(solid, kind, shapes);
    for (int i = 1; i <= shapes.Extent(); ++i) {
      const Handle(BRepCheck_Result)& result = analyzer.Result(shapes(i));
      if (result.IsNull()) continue;
      if (const std::string errors = errors_of(result); !errors.empty())
        return face_text(solid, shapes(i)) + ": " + errors;
      for (result->InitContextIterator(); result->MoreShapeInContext(); result->NextShapeInContext())
        for (BRepCheck_ListIteratorOfListOfStatus at(result->StatusOnShape()); at.More(); at.Next())
          if (at.Value() != BRepCheck_NoError)
            return face_text(solid, shapes(i)) + ": " + "does not agree with its neighbours";
    }
  }
  return "near " + centre_text(solid) + ": its shape is invalid";
}

double signed_volume(const TopoDS_Shape& solid) {
  GProp_GProps properties;
  BRepGProp::VolumeProperties(solid, properties);
  return properties.Mass();
}

bool has_name(const CadPart& part, const std::string& name) {
  return part.name == name || part.name.starts_with(name + "#");
}

}  // namespace

CadModel read_cad(const std::string& bytes, const CadReading& reading) {
  CadModel model;
  try {
    if (reading.format == CadFormat::step)
      read_step(bytes, reading, model);
    else
      read_brep(bytes, reading, model);
  } catch (const Standard_Failure& failure) {
    throw ImportError(std::string("is damaged (") + failure.DynamicType()->Name() + "); export it again");
  }
  if (model.parts.empty()) throw ImportError("contains no solid and no surface; export the solids");
  return model;
}

void select_parts(CadModel& model, const std::vector<std::string>& names, bool skip_surfaces) {
  for (const std::string& name : names)
    if (std::none_of(model.parts.begin(), model.parts.end(),
                     [&](const CadPart& part) { return has_name(part, name); }))
      throw ImportError("has no part '" + name + "'; --list shows its parts");
  if (!names.empty())
    std::erase_if(model.parts, [&](const CadPart& part) {
      return std::none_of(names.begin(), names.end(),
                          [&](const std::string& name) { return has_name(part, name); });
    });
  for (const CadPart& part : model.parts) {
    if (part.free_faces == 0) continue;
    const std::string what = "part '" + part.name + "' near " + part.free_face_place + ": " +
                             std::to_string(part.free_faces) + " faces bound no solid";
    if (!skip_surfaces)
      throw ImportError(
          what + "; join them to a closed solid in the CAD program" +
          (model.parts.size() > 1 || !part.solids.empty() ? ", or leave them out with --skip-surfaces" : ""));
    model.remarks.push_back(what + "; they are left out");
  }
  std::erase_if(model.parts, [](const CadPart& part) { return part.solids.empty(); });
  if (model.parts.empty()) throw ImportError("contains no solid; export closed solids, not surfaces");
}

TopoDS_Solid checked_solid(const TopoDS_Solid& solid, const std::string& part,
                           std::vector<std::string>& remarks) {
  const std::string place = "part '" + part + "', ";
  try {
    TopoDS_Solid checked = solid;
    if (BRepCheck_Analyzer analyzer(checked); !analyzer.IsValid()) {
      const std::string defect = first_defect(checked, analyzer);
      ShapeFix_Shape fix(checked);
      fix.Perform();
      const TopoDS_Shape fixed = fix.Shape();
      if (fixed.IsNull() || fixed.ShapeType() != TopAbs_SOLID || !BRepCheck_Analyzer(fixed).IsValid())
        throw ImportError(place + defect + "; repair this face in the CAD program");
      checked = TopoDS::Solid(fixed);
      remarks.push_back(place + defect + "; OpenCASCADE repaired it");
    }
    const double volume_mm3 = signed_volume(checked);
    if (volume_mm3 < 0.0) {
      checked.Reverse();
      remarks.push_back(place + "its faces point inwards; they are reversed");
    }
    if (!(std::abs(volume_mm3) > 0.0))
      throw ImportError(place + "near " + centre_text(checked) + ": has no volume; export a closed solid");
    return checked;
  } catch (const Standard_Failure& failure) {
    throw ImportError(place + "near " + centre_text(solid) + ": cannot be checked (" +
                      failure.DynamicType()->Name() + "); repair it in the CAD program");
  }
}

}  // namespace wrenchd
