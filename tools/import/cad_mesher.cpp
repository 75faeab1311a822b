// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/cad_mesher.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include <BRepAdaptor_Surface.hxx>
#include <BRepBndLib.hxx>
#include <BRepGProp.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GProp_GProps.hxx>
#include <Poly_PolygonOnTriangulation.hxx>
#include <Poly_Triangulation.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Vertex.hxx>

#include "tools/import/chord_error.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

/// Largest angle between neighbouring segments of a curve [rad]. It keeps small holes round.
constexpr double kAngle_rad = 0.6;
constexpr int kMaxPasses = 14;

/// Numbers that are joined to sets.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), std::uint32_t{0});
  }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// The triangulations of all faces of a solid as one closed mesh.
///
/// BRepMesh triangulates each face by itself, but cuts an edge into the same segments in all faces. So the
/// i-th node of an edge is one vertex in all faces that have the edge. The ends of all edges at a corner are
/// one vertex, and so are all nodes of an edge without length, for example at the pole of a sphere.
class WeldedMesh {
 public:
  /// Throws ImportError if a face has no triangulation.
  explicit WeldedMesh(const TopoDS_Solid& solid) {
    TopExp::MapShapes(solid, TopAbs_FACE, faces_);
    TopExp::MapShapes(solid, TopAbs_EDGE, edges_);
    TopExp::MapShapes(solid, TopAbs_VERTEX, corners_);
    std::size_t nodes = 0;
    for (int f = 1; f <= faces_.Extent(); ++f) {
      first_node_.push_back(static_cast<std::uint32_t>(nodes));
      TopLoc_Location location;
      const auto& triangulation = BRep_Tool::Triangulation(TopoDS::Face(faces_(f)), location);
      if (triangulation.IsNull() || !triangulation->HasUVNodes()) {
        missing_face_ = f;
        return;
      }
      nodes += static_cast<std::size_t>(triangulation->NbNodes());
    }
    nodes_.reserve(nodes);
    sets_.emplace(nodes);
    edge_nodes_.resize(static_cast<std::size_t>(edges_.Extent()));
    corner_node_.resize(static_cast<std::size_t>(corners_.Extent()));
    for (int f = 1; f <= faces_.Extent(); ++f) add_nodes(f);
    make_vertices();
    // The solid says on which side of a face its inside is.
    for (TopExp_Explorer at(solid, TopAbs_FACE); at.More(); at.Next()) add_triangles(at.Current());
  }

  int missing_face() const { return missing_face_; }  ///< a face without triangulation, from 1; 0: none
  const TriangleMesh& mesh() const { return mesh_; }
  std::size_t curved_triangles() const {
    return curved_triangles_;
  }  ///< triangles of faces that are not plane

  ChordError measure() const {
    ChordError worst;
    for (int e = 1; e <= edges_.Extent(); ++e) {
      const EdgeNodes& edge = edge_nodes_[static_cast<std::size_t>(e - 1)];
      if (edge.nodes.empty() || edge.parameters.empty()) continue;
      EdgeSegments segments{TopoDS::Edge(edges_(e)), edge.face, {}, edge.parameters};
      for (const std::uint32_t node : edge.nodes) segments.points_mm.push_back(position(node));
      measure_edge(segments, worst);
    }
    for (int f = 1; f <= faces_.Extent(); ++f) measure_face(triangles_of(f), worst);
    return worst;
  }

 private:
  struct EdgeNodes {
    int face = 0;                      ///< the first face that has the edge
    std::vector<std::uint32_t> nodes;  ///< along the curve
    std::vector<double> parameters;
  };

  Vector3d position(std::uint32_t node) const { return mesh_.vertices_m[vertex_[node]]; }

  void add_nodes(int f) {
    const TopoDS_Face face = TopoDS::Face(faces_(f));
    TopLoc_Location location;
    const auto& triangulation = BRep_Tool::Triangulation(face, location);
    const gp_Trsf placed = location.Transformation();
    for (int i = 1; i <= triangulation->NbNodes(); ++i) {
      const gp_Pnt p = triangulation->Node(i).Transformed(placed);
      nodes_.emplace_back(p.X(), p.Y(), p.Z());
    }
    for (TopExp_Explorer at(face, TopAbs_EDGE); at.More(); at.Next())  // a seam comes twice
      join_edge(f, TopoDS::Edge(at.Current()),
                BRep_Tool::PolygonOnTriangulation(TopoDS::Edge(at.Current()), triangulation, location));
  }

  void join_edge(int f, const TopoDS_Edge& edge, const Handle(Poly_PolygonOnTriangulation) & polygon) {
    if (polygon.IsNull()) return;
    std::vector<std::uint32_t> nodes;
    for (int i = 1; i <= polygon->NbNodes(); ++i)
      nodes.push_back(first_node_[static_cast<std::size_t>(f - 1)] +
                      static_cast<std::uint32_t>(polygon->Node(i)) - 1);
    const bool no_length = BRep_Tool::Degenerated(edge);
    if (no_length)
      for (const std::uint32_t node : nodes) sets_->join(nodes.front(), node);
    EdgeNodes& known = edge_nodes_[static_cast<std::size_t>(edges_.FindIndex(edge) - 1)];
    if (known.nodes.empty() && !no_length) {
      known.face = f;
      known.nodes = nodes;
      if (polygon->HasParameters())
        for (int i = 1; i <= polygon->NbNodes(); ++i) known.parameters.push_back(polygon->Parameter(i));
    } else if (known.nodes.size() == nodes.size()) {
      for (std::size_t i = 0; i < nodes.size(); ++i) sets_->join(known.nodes[i], nodes[i]);
    }
    join_corner(TopExp::FirstVertex(edge), nodes.front());
    join_corner(TopExp::LastVertex(edge), nodes.back());
  }

  void join_corner(const TopoDS_Vertex& corner, std::uint32_t node) {
    const int at = corner.IsNull() ? 0 : corners_.FindIndex(corner);
    if (at == 0) return;
    auto& known = corner_node_[static_cast<std::size_t>(at - 1)];
    if (known)
      sets_->join(*known, node);
    else
      known = node;
  }

  void make_vertices() {
    vertex_.resize(nodes_.size());
    for (std::uint32_t i = 0; i < nodes_.size(); ++i) {
      const std::uint32_t root = sets_->find(i);  // the smallest number of its set
      if (root == i) {
        vertex_[i] = static_cast<std::uint32_t>(mesh_.vertices_m.size());
        mesh_.vertices_m.push_back(nodes_[i]);
      } else {
        vertex_[i] = vertex_[root];
      }
    }
  }

  void add_triangles(const TopoDS_Shape& face) {
    TopLoc_Location location;
    const auto& triangulation = BRep_Tool::Triangulation(TopoDS::Face(face), location);
    const bool mirrored = location.Transformation().IsNegative();
    const bool reversed = (face.Orientation() == TopAbs_REVERSED) != mirrored;
    const std::uint32_t first = first_node_[static_cast<std::size_t>(faces_.FindIndex(face) - 1)];
    if (BRepAdaptor_Surface(TopoDS::Face(face), false).GetType() != GeomAbs_Plane)
      curved_triangles_ += static_cast<std::size_t>(triangulation->NbTriangles());
    for (int i = 1; i <= triangulation->NbTriangles(); ++i) {
      std::array<int, 3> n{};
      triangulation->Triangle(i).Get(n[0], n[1], n[2]);
      if (reversed) std::swap(n[1], n[2]);
      std::array<std::uint32_t, 3> t{};
      for (std::size_t k = 0; k < 3; ++k) t[k] = vertex_[first + static_cast<std::uint32_t>(n[k]) - 1];
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh_.triangles.push_back(t);
    }
  }

  FaceTriangles triangles_of(int f) const {
    FaceTriangles out;
    out.face = TopoDS::Face(faces_(f));
    out.number = f;
    TopLoc_Location location;
    const auto& triangulation = BRep_Tool::Triangulation(out.face, location);
    const std::uint32_t first = first_node_[static_cast<std::size_t>(f - 1)];
    for (int i = 1; i <= triangulation->NbNodes(); ++i) {
      out.corners_mm.push_back(position(first + static_cast<std::uint32_t>(i) - 1));
      const gp_Pnt2d w = triangulation->UVNode(i);
      out.parameters.push_back({w.X(), w.Y()});
    }
    for (int i = 1; i <= triangulation->NbTriangles(); ++i) {
      std::array<int, 3> n{};
      triangulation->Triangle(i).Get(n[0], n[1], n[2]);
      out.triangles.push_back({static_cast<std::uint32_t>(n[0] - 1), static_cast<std::uint32_t>(n[1] - 1),
                               static_cast<std::uint32_t>(n[2] - 1)});
    }
    return out;
  }

  TopTools_IndexedMapOfShape faces_, edges_, corners_;
  std::vector<std::uint32_t> first_node_;  ///< index of the first node of each face in nodes_
  std::vector<Vector3d> nodes_;            ///< nodes of all faces, face after face [mm]
  std::optional<DisjointSets> sets_;
  std::vector<EdgeNodes> edge_nodes_;
  std::vector<std::optional<std::uint32_t>> corner_node_;
  std::vector<std::uint32_t> vertex_;  ///< vertex of each node
  TriangleMesh mesh_;
  std::size_t curved_triangles_ = 0;
  int missing_face_ = 0;
};

/// A mesh of a solid in the frame of its shape, without its location.
struct MeshedSolid {
  TriangleMesh mesh;
  double chord_error_mm = 0.0;
  int worst_face = 0;
  Vector3d worst_place_mm = Vector3d::Zero();
};

double diagonal_mm(const TopoDS_Shape& shape) {
  Bnd_Box box;
  BRepBndLib::Add(shape, box, false);
  return box.IsVoid() ? 0.0 : std::sqrt(box.SquareExtent());
}

std::string place_in(const std::string& part, int face, const Vector3d& p) {
  return "part '" + part + "', face " + std::to_string(face) + " near " + place_text(p.x(), p.y(), p.z());
}

[[noreturn]] void reject_triangles(const std::string& part, const MeshingLimits& limits) {
  throw ImportError("part '" + part + "': a chord error of " + short_number(limits.chord_mm) +
                    " mm needs more than " + std::to_string(limits.triangles) +
                    " triangles; use a coarser --chord, select parts with --part, or raise "
                    "--max-triangles");
}

/// Refines the tessellation until the measured chord error is small enough. The deflection that BRepMesh
/// takes is only a hint. It starts coarse, so that a chord error that needs too many triangles is rejected
/// before they exist.
MeshedSolid mesh_solid(const TopoDS_Solid& solid, const std::string& part, const MeshingLimits& limits) {
  constexpr double kCoarseStart = 1.0 / 300.0;  // of the diagonal
  double deflection_mm = std::max(limits.chord_mm, kCoarseStart * diagonal_mm(solid));
  constexpr double kLeastProgress = 0.95;
  constexpr int kMaxIdlePasses = 3;
  ChordError worst;
  int missing_face = 0, idle_passes = 0;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    BRepTools::Clean(solid);
    IMeshTools_Parameters parameters;
    parameters.Deflection = deflection_mm;
    parameters.Angle = kAngle_rad;
    BRepMesh_IncrementalMesh mesher(solid, parameters);
    const WeldedMesh welded(solid);
    missing_face = welded.missing_face();
    double next_mm = 0.5 * deflection_mm;
    if (missing_face == 0) {
      const std::size_t triangles = welded.mesh().triangles.size();
      if (triangles > limits.triangles) reject_triangles(part, limits);
      const double previous_mm = worst.mm;
      worst = welded.measure();
      worst.mm *= kSamplingFactor;
      if (worst.mm <= limits.chord_mm) return {welded.mesh(), worst.mm, worst.face, worst.place_mm};
      // The angle between segments can keep the error far below the deflection.
      next_mm = std::min(deflection_mm, worst.mm) * std::clamp(0.8 * limits.chord_mm / worst.mm, 0.05, 0.7);
      // The triangles of curved faces grow at least with the root of the refinement; half of it to be safe.
      const double growth = 0.5 * std::sqrt(worst.mm / limits.chord_mm);
      if (growth * static_cast<double>(welded.curved_triangles()) > static_cast<double>(limits.triangles))
        reject_triangles(part, limits);
      // A finer mesh of a valid face is nearer to it.
      if (pass > 0 && worst.mm > kLeastProgress * previous_mm && ++idle_passes == kMaxIdlePasses) break;
    }
    deflection_mm = next_mm;
  }
  if (missing_face > 0)
    throw ImportError("part '" + part + "', face " + std::to_string(missing_face) +
                      ": cannot be divided into triangles; repair this face in the CAD program");
  throw ImportError(place_in(part, worst.face, worst.place_mm) + ": the chord error is " +
                    short_number(worst.mm) + " mm and no smaller with more triangles, above --chord " +
                    short_number(limits.chord_mm) + "mm; use a coarser --chord, or repair this face");
}

/// Meshes each different solid once; an assembly may have hundreds of the same bolt.
class SolidMesher {
 public:
  explicit SolidMesher(const MeshingLimits& limits) : limits_(limits) {}

  MeshedSolid mesh(const TopoDS_Solid& solid, const std::string& part) {
    const gp_Trsf placed = solid.Location().Transformation();
    const bool rigid = std::abs(placed.ScaleFactor() - 1.0) < 1e-12 && !placed.IsNegative();
    if (!rigid) return count(mesh_solid(solid, part, rest()), part);
    const auto key = std::pair(solid.TShape().get(), solid.Orientation());
    auto known = known_.find(key);
    if (known == known_.end()) {
      const TopoDS_Solid unplaced = TopoDS::Solid(solid.Located(TopLoc_Location()));
      known = known_.emplace(key, mesh_solid(unplaced, part, rest())).first;
    }
    MeshedSolid out = known->second;
    const auto place = [&](Vector3d& p) {
      const gp_Pnt q = gp_Pnt(p.x(), p.y(), p.z()).Transformed(placed);
      p = {q.X(), q.Y(), q.Z()};
    };
    for (Vector3d& p : out.mesh.vertices_m) place(p);
    place(out.worst_place_mm);
    return count(std::move(out), part);
  }

 private:
  MeshingLimits rest() const { return {limits_.chord_mm, limits_.triangles - triangles_}; }
  MeshedSolid count(MeshedSolid solid, const std::string& part) {
    triangles_ += solid.mesh.triangles.size();
    if (triangles_ > limits_.triangles) reject_triangles(part, limits_);
    return solid;
  }

  MeshingLimits limits_;
  std::size_t triangles_ = 0;
  std::map<std::pair<const TopoDS_TShape*, TopAbs_Orientation>, MeshedSolid> known_;
};

}  // namespace

GeometricProperties exact_properties(const TopoDS_Solid& solid) {
  GProp_GProps volume, surface;
  BRepGProp::VolumeProperties(solid, volume);
  BRepGProp::SurfaceProperties(solid, surface);
  GeometricProperties out;
  out.volume_mm3 = volume.Mass();
  out.area_mm2 = surface.Mass();
  const gp_Pnt centre = volume.CentreOfMass();
  out.centre_mm = {centre.X(), centre.Y(), centre.Z()};
  const gp_Mat inertia = volume.MatrixOfInertia();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.inertia_mm5(i, j) = inertia(i + 1, j + 1);
  return out;
}

ImportedFile mesh_model(CadModel model, const MeshingLimits& limits) {
  ImportedFile file;
  file.unit = model.unit;
  file.remarks = std::move(model.remarks);
  SolidMesher mesher(limits);
  for (CadPart& cad : model.parts) {
    ImportedPart& part = file.parts.emplace_back();
    part.name = cad.name;
    part.has_exact_surface = true;
    for (const TopoDS_Solid& unchecked : cad.solids) {
      const TopoDS_Solid solid = checked_solid(unchecked, cad.name, file.remarks);
      try {
        MeshedSolid meshed = mesher.mesh(solid, cad.name);
        const GeometricProperties exact = exact_properties(solid);
        part.exact = part.meshes.empty() ? exact : sum(part.exact, exact);
        part.meshes.push_back(std::move(meshed.mesh));
        if (meshed.chord_error_mm < part.chord_error_mm) continue;
        part.chord_error_mm = meshed.chord_error_mm;
        part.worst_place = place_in(cad.name, meshed.worst_face, meshed.worst_place_mm);
      } catch (const Standard_Failure& failure) {
        throw ImportError("part '" + cad.name + "': cannot be divided into triangles (" +
                          failure.DynamicType()->Name() + "); repair it in the CAD program");
      }
    }
  }
  return file;
}

std::vector<PartSummary> summarize(const CadModel& model) {
  std::vector<PartSummary> all;
  for (const CadPart& part : model.parts) {
    Bnd_Box box;
    for (const TopoDS_Solid& solid : part.solids) BRepBndLib::Add(solid, box, false);
    std::string text = std::to_string(part.solids.size()) + (part.solids.size() == 1 ? " solid" : " solids");
    if (!box.IsVoid()) {
      double x0 = 0, y0 = 0, z0 = 0, x1 = 0, y1 = 0, z1 = 0;
      box.Get(x0, y0, z0, x1, y1, z1);
      text += ", " + short_number(x1 - x0) + " x " + short_number(y1 - y0) + " x " + short_number(z1 - z0) +
              " mm";
    }
    if (part.free_faces > 0) text += ", " + std::to_string(part.free_faces) + " faces that bound no solid";
    all.push_back({part.name, text});
  }
  return all;
}

}  // namespace wrenchd
