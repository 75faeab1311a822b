// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <functional>

#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/tools/import/sample_cad.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/import_file.hpp"
#include "tools/import/imported_body.hpp"

namespace wrenchd::test_cad_import {

namespace {

using namespace test;

/// Imports a file with this content.
ImportedFile imported(const std::string& bytes, ImportJob job = {}, const char* name = "part.step") {
  const TemporaryDirectory dir;
  job.file = dir.write(name, bytes);
  return import_file(job);
}

std::string rejection(const std::string& bytes, const ImportJob& job = {}, const char* name = "part.step") {
  return rejection_message<ImportError>([&] { join_parts(imported(bytes, job, name)); });
}

bool contains(const std::string& text, const std::string& part) {
  INFO(text << "\nlacks " << part);
  const bool found = text.find(part) != std::string::npos;
  CHECK(found);
  return found;
}

MeshReport report_of(const TriangleMesh& mesh) {
  PolygonSoup soup;
  soup.vertices = mesh.vertices_m;
  for (const auto& t : mesh.triangles) soup.faces.push_back({t[0], t[1], t[2]});
  return repair_and_check_solid(soup);
}

/// Closed, oriented, without intersections, and without a repair.
void check_watertight(const TriangleMesh& mesh) {
  const MeshReport report = report_of(mesh);
  CHECK(report.closed);
  CHECK(report.consistent);
  CHECK(report.outward);
  CHECK(report.solid());
  for (const std::string& repair : report.repairs) FAIL_CHECK(repair);
}

/// Returns the largest distance of points of the triangles from a surface. selects: a triangle of this
/// surface, by its corners. A grid of its own, finer than that of the importer.
double largest_distance(const TriangleMesh& mesh, const std::function<double(const Vector3d&)>& distance,
                        const std::function<bool(const Vector3d&)>& selects) {
  constexpr int n = 20;
  double largest = 0.0;
  for (const auto& t : mesh.triangles) {
    const Vector3d &a = mesh.vertices_m[t[0]], &b = mesh.vertices_m[t[1]], &c = mesh.vertices_m[t[2]];
    if (!selects(a) || !selects(b) || !selects(c)) continue;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n - i; ++j)
        largest = std::max(largest, std::abs(distance((i * a + j * b + (n - i - j) * c) / n)));
  }
  return largest;
}

/// Checks the measured error of the only part against the true one, and the exact properties.
void check_error(const ImportedPart& part, double true_mm, double chord_mm) {
  INFO("stated " << part.chord_error_mm << " mm, true " << true_mm << " mm, chord " << chord_mm << " mm");
  CHECK(part.chord_error_mm <= chord_mm);
  CHECK(true_mm <= part.chord_error_mm);
  CHECK(part.chord_error_mm < 1.1 * true_mm);  // the statement is no empty bound
}

bool near(double a, double b, double relative) {
  INFO(a << " is not " << b);
  const bool is = std::abs(a - b) <= relative * std::abs(b);
  CHECK(is);
  return is;
}

void check_properties(const GeometricProperties& found, double volume_mm3, const Vector3d& centre_mm,
                      const Matrix3d& inertia_mm5, double relative) {
  near(found.volume_mm3, volume_mm3, relative);
  CHECK((found.centre_mm - centre_mm).norm() < relative * std::cbrt(volume_mm3));
  INFO(found.inertia_mm5 << "\nis not\n" << inertia_mm5);
  CHECK((found.inertia_mm5 - inertia_mm5).cwiseAbs().maxCoeff() <
        relative * inertia_mm5.cwiseAbs().maxCoeff());
}

Matrix3d diagonal(double x, double y, double z) {
  return Vector3d(x, y, z).asDiagonal();
}

/// The mesh differs from the exact solid by at most the area times the chord error.
void check_mesh_volume(const ImportedPart& part) {
  const GeometricProperties mesh = geometric_properties(part.meshes.front());
  CHECK(std::abs(mesh.volume_mm3 - part.exact.volume_mm3) <=
        1.01 * part.exact.area_mm2 * part.chord_error_mm + 1e-9 * part.exact.volume_mm3);
}

}  // namespace

TEST_CASE("a sphere is imported within the chord error, at every chord") {
  const double R = 25.0, V = 4.0 / 3.0 * M_PI * R * R * R;
  const std::string step = step_of(BRepPrimAPI_MakeSphere(R).Shape());
  for (const double chord_mm : {1.0, 0.1, 0.02}) {
    ImportJob job;
    job.chord_mm = chord_mm;
    const ImportedFile file = imported(step, job);
    REQUIRE(file.parts.size() == 1);
    const ImportedPart& part = file.parts.front();
    REQUIRE(part.meshes.size() == 1);
    check_watertight(part.meshes.front());
    check_properties(part.exact, V, {0, 0, 0}, 0.4 * V * R * R * Matrix3d::Identity(), 1e-6);
    check_mesh_volume(part);
    check_error(part,
                largest_distance(
                    part.meshes.front(), [&](const Vector3d& p) { return p.norm() - R; },
                    [](const Vector3d&) { return true; }),
                chord_mm);
  }
}

TEST_CASE("a cylinder is imported within the chord error, also at its round edges") {
  const double R = 10.0, h = 30.0, V = M_PI * R * R * h;
  ImportJob job;
  job.chord_mm = 0.01;
  const ImportedFile file = imported(step_of(BRepPrimAPI_MakeCylinder(R, h).Shape()), job);
  const ImportedPart& part = file.parts.front();
  check_watertight(part.meshes.front());
  const double across = V * (3.0 * R * R + h * h) / 12.0;
  check_properties(part.exact, V, {0, 0, 0.5 * h}, diagonal(across, across, 0.5 * V * R * R), 1e-6);
  check_mesh_volume(part);
  const auto radius = [](const Vector3d& p) { return std::hypot(p.x(), p.y()); };
  // The triangles of the flat ends are chosen too, where all three corners are on their border; their largest
  // radial distance would be large, so only those of the side count.
  double largest = 0.0;
  const TriangleMesh& mesh = part.meshes.front();
  for (const auto& t : mesh.triangles) {
    const double z0 = mesh.vertices_m[t[0]].z(), z1 = mesh.vertices_m[t[1]].z(),
                 z2 = mesh.vertices_m[t[2]].z();
    if (std::abs(z0 - z1) < 1e-9 && std::abs(z1 - z2) < 1e-9) continue;
    TriangleMesh one;
    one.vertices_m = {mesh.vertices_m[t[0]], mesh.vertices_m[t[1]], mesh.vertices_m[t[2]]};
    one.triangles = {{0, 1, 2}};
    largest = std::max(largest, largest_distance(
                                    one, [&](const Vector3d& p) { return radius(p) - R; },
                                    [](const Vector3d&) { return true; }));
  }
  check_error(part, largest, job.chord_mm);
}

TEST_CASE("a torus is imported within the chord error") {
  const double R = 30.0, r = 8.0, V = 2.0 * M_PI * M_PI * R * r * r;
  ImportJob job;
  job.chord_mm = 0.05;
  const ImportedFile file = imported(step_of(BRepPrimAPI_MakeTorus(R, r).Shape()), job);
  const ImportedPart& part = file.parts.front();
  check_watertight(part.meshes.front());
  const double along = V * (R * R + 0.75 * r * r), across = V * (0.5 * R * R + 0.625 * r * r);
  check_properties(part.exact, V, {0, 0, 0}, diagonal(across, across, along), 1e-6);
  check_mesh_volume(part);
  check_error(part,
              largest_distance(
                  part.meshes.front(),
                  [&](const Vector3d& p) { return std::hypot(std::hypot(p.x(), p.y()) - R, p.z()) - r; },
                  [](const Vector3d&) { return true; }),
              job.chord_mm);
}

TEST_CASE("a cone with its tip and a filleted box are watertight within the chord error") {
  TopoDS_Shape box = BRepPrimAPI_MakeBox(40.0, 30.0, 20.0).Shape();
  BRepFilletAPI_MakeFillet fillet(box);
  for (TopExp_Explorer edge(box, TopAbs_EDGE); edge.More(); edge.Next())
    fillet.Add(4.0, TopoDS::Edge(edge.Current()));
  for (const TopoDS_Shape& shape : {BRepPrimAPI_MakeCone(12.0, 0.0, 25.0).Shape(), fillet.Shape()}) {
    const ImportedFile file = imported(step_of(shape));
    const ImportedPart& part = file.parts.front();
    check_watertight(part.meshes.front());
    check_mesh_volume(part);
    CHECK(part.chord_error_mm <= 0.02);
    CHECK(part.chord_error_mm > 0.001);
  }
}

TEST_CASE("a plate with a hole has the exact properties, and its hole the chord error") {
  const ImportedFile file = imported(step_of(plate_with_hole()));
  const ImportedPart& part = file.parts.front();
  check_watertight(part.meshes.front());
  const double B = 60.0 * 40.0 * 10.0, H = M_PI * 64.0 * 10.0, V = B - H;
  const Matrix3d inertia =
      diagonal(B * (1600.0 + 100.0) / 12.0, B * (3600.0 + 100.0) / 12.0, B * (3600.0 + 1600.0) / 12.0) -
      diagonal(H * (3 * 64.0 + 100.0) / 12.0, H * (3 * 64.0 + 100.0) / 12.0, 0.5 * H * 64.0);
  check_properties(part.exact, V, {30, 20, 5}, inertia, 1e-6);
  check_mesh_volume(part);
  const GeometricProperties mesh = geometric_properties(part.meshes.front());
  CHECK(mesh.volume_mm3 > V);  // chords make a hole smaller
  const auto from_axis = [](const Vector3d& p) { return std::hypot(p.x() - 30.0, p.y() - 20.0); };
  check_error(part,
              largest_distance(
                  part.meshes.front(), [&](const Vector3d& p) { return from_axis(p) - 8.0; },
                  [&](const Vector3d& p) { return std::abs(from_axis(p) - 8.0) < 1e-6; }),
              0.02);
}

TEST_CASE("a file in inches has the same size in millimetres") {
  const TopoDS_Shape plate = plate_with_hole();
  const ImportedFile mm = imported(step_of(plate)), inch = imported(step_of(plate, "INCH")),
                     m = imported(step_of(plate, "M"));
  CHECK(inch.unit == "inch");
  near(inch.parts.front().exact.volume_mm3, mm.parts.front().exact.volume_mm3, 1e-9);
  near(m.parts.front().exact.volume_mm3, mm.parts.front().exact.volume_mm3, 1e-9);
  CHECK((inch.parts.front().exact.centre_mm - Vector3d(30, 20, 5)).norm() < 1e-7);
}

TEST_CASE("an assembly becomes one body, or the parts that are named") {
  const TopoDS_Shape plate = plate_with_hole(), pin = BRepPrimAPI_MakeCylinder(3.0, 20.0).Shape();
  const std::string step =
      step_of({{"plate", plate}, {"pin", pin, at(10, 20, 30)}, {"pin", pin, turned_at(0.5, 50, 20, 30)}});
  const double pin_volume = M_PI * 9.0 * 20.0;
  const ImportedFile all = imported(step);
  REQUIRE(all.parts.size() == 3);
  const ImportedBody body = join_parts(all);
  CHECK(body.overlap_mm3 == 0.0);
  near(body.exact.volume_mm3, 24000.0 - 640.0 * M_PI + 2.0 * pin_volume, 1e-6);
  near(geometric_properties(body.mesh_mm).volume_mm3, body.exact.volume_mm3, 1e-3);

  ImportJob one;
  one.parts = {"pin#2"};
  const ImportedFile second = imported(step, one);
  REQUIRE(second.parts.size() == 1);
  near(second.parts.front().exact.volume_mm3, pin_volume, 1e-6);
  CHECK((second.parts.front().exact.centre_mm - Vector3d(50, 20, 40)).norm() < 1e-6);
  one.parts = {"pin"};
  CHECK(imported(step, one).parts.size() == 2);
  one.parts = {"pim"};
  contains(rejection(step, one), "has no part 'pim'; --list shows its parts");

  const TemporaryDirectory dir;
  ImportJob list;
  list.file = dir.write("a.step", step);
  const auto parts = list_parts(list);
  REQUIRE(parts.size() == 3);
  CHECK(parts[0].name == "plate");
  contains(parts[0].description, "1 solid, 60 x 40 x 10 mm");
  CHECK(parts[1].name == "pin");
  CHECK(parts[2].name == "pin#2");
}

TEST_CASE("solids that overlap are rejected with both parts and the place, or become their union") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape();
  const TopoDS_Shape other = BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape();
  const TopoDS_Shape small = BRepPrimAPI_MakeBox(2.0, 2.0, 2.0).Shape();
  const ImportedFile overlap =
      imported(step_of({{"post", small, at(50, 0, 0)}, {"a", box}, {"b", other, at(5, 2, 1)}}));
  contains(
      rejection_message<ImportError>([&] { join_parts(overlap); }),
      "parts 'a' and 'b' overlap by 360 mm^3 near (7.5, 6, 5.5) mm; correct this in the CAD program, make "
      "each part an obstacle with -o NAME.toml, select parts with --part, or accept the union with --unite");
  const ImportedBody united = join_parts(overlap, {.unite = true});
  near(united.overlap_mm3, 5.0 * 8.0 * 9.0, 1e-9);
  near(geometric_properties(united.mesh_mm).volume_mm3, 2008.0 - 360.0, 1e-9);
  REQUIRE(united.remarks.size() == 1);
  contains(united.remarks.front(), "3 solids overlap by 360 mm^3");

  const ImportedFile inside = imported(step_of({{"a", box}, {"b", small, at(4, 4, 4)}}));
  contains(rejection_message<ImportError>([&] { join_parts(inside); }),
           "overlap by 8 mm^3 near (5, 5, 5) mm");
  const ImportedBody swallowed = join_parts(inside, {.unite = true});
  near(swallowed.overlap_mm3, 8.0, 1e-9);
  near(geometric_properties(swallowed.mesh_mm).volume_mm3, 1000.0, 1e-9);

  BRep_Builder builder;
  TopoDS_Compound both;
  builder.MakeCompound(both);
  builder.Add(both, box);
  builder.Add(both, box.Moved(at(5, 2, 1)));
  ImportJob mm;
  mm.unit_mm = 1.0;
  contains(rejection(brep_of(both), mm, "a.brep"), "two solids of part 'part' overlap by 360 mm^3");
}

TEST_CASE("solids that touch become their union, also where their round faces overlap by the chord error") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape();
  const ImportedBody boxes = join_parts(imported(step_of({{"a", box}, {"b", box, at(10, 3, 0)}})));
  near(geometric_properties(boxes.mesh_mm).volume_mm3, 2000.0, 1e-9);
  REQUIRE(boxes.remarks.size() == 1);
  contains(boxes.remarks.front(), "touch");

  // The segments of the pin and of its hole are at different angles.
  const TopoDS_Shape pin = BRepPrimAPI_MakeCylinder(8.0, 30.0).Shape();
  const auto pinned = [&](double radius_mm) {
    const TopoDS_Shape shape = radius_mm == 8.0 ? pin : BRepPrimAPI_MakeCylinder(radius_mm, 30.0).Shape();
    return imported(step_of({{"plate", plate_with_hole()}, {"pin", shape, turned_at(0.1, 30, 20, -10)}}));
  };
  const ImportedBody fitted = join_parts(pinned(8.0));
  near(geometric_properties(fitted.mesh_mm).volume_mm3, 24000.0 + M_PI * 64.0 * 20.0, 1e-3);
  contains(fitted.remarks.front(), "touch");
  contains(rejection_message<ImportError>([&] { join_parts(pinned(8.1)); }),
           "parts 'plate' and 'pin' overlap by");
  CHECK(join_parts(pinned(7.9)).remarks.empty());  // a clearance
}

TEST_CASE("a CAD file that cannot be imported is rejected with place and remedy") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(20.0, 20.0, 20.0).Shape();
  const std::string step = step_of(box);

  SECTION("a shell that is open") {
    BRepBuilderAPI_Sewing sewing;
    int faces = 0;
    for (TopExp_Explorer face(box, TopAbs_FACE); face.More() && faces < 5; face.Next(), ++faces)
      sewing.Add(face.Current());
    sewing.Perform();
    const std::string shell = step_of(sewing.SewedShape());
    const std::string message = rejection(shell);
    contains(message, "near (");
    contains(message, "5 faces bound no solid; join them to a closed solid in the CAD program");
    ImportJob skip;
    skip.skip_surfaces = true;
    contains(rejection(shell, skip), "contains no solid; export closed solids, not surfaces");
  }
  SECTION("a surface beside a solid") {
    BRep_Builder builder;
    TopoDS_Compound both;
    builder.MakeCompound(both);
    builder.Add(both, box);
    builder.Add(both, BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 50), gp_Dir(0, 0, 1)), 0, 5, 0, 5).Face());
    const std::string mixed = step_of(both);
    contains(rejection(mixed), "leave them out with --skip-surfaces");
    ImportJob skip;
    skip.skip_surfaces = true;
    const ImportedFile file = imported(mixed, skip);
    CHECK(file.parts.size() == 1);
    REQUIRE(file.remarks.size() == 1);
    contains(file.remarks.front(), "left out");
  }
  SECTION("a file that is no STEP, truncated, or damaged") {
    contains(rejection("solid cube\n"), "is not a STEP file");
    contains(rejection(""), "is empty; export it again");
    contains(rejection(step.substr(0, step.size() / 2)), "export it again");
    std::string damaged = step;
    damaged.replace(damaged.find("CARTESIAN_POINT('"), 17, "CARTESIAN_PO(((((");
    CHECK(!rejection(damaged).empty());
  }
  SECTION("a file without a shape") {
    contains(rejection("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
                       "FILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\n"
                       "DATA;\nENDSEC;\nEND-ISO-10303-21;\n"),
             "contains no shape");
  }
  SECTION("a chord that needs too many triangles") {
    ImportJob fine;
    fine.chord_mm = 1e-6;
    fine.max_triangles = 10'000;
    const std::string message = rejection(step_of(BRepPrimAPI_MakeSphere(50.0).Shape()), fine);
    contains(message, "needs more than 10000 triangles; use a coarser --chord");
  }
  SECTION("a unit that the file states already, or that it lacks") {
    ImportJob unit;
    unit.unit_mm = 25.4;
    contains(rejection(step, unit), "states its unit (millimetre); leave --unit out");
    const std::string brep = brep_of(box);
    contains(rejection(brep, {}, "a.brep"), "states no unit of length; give it with --unit");
    const ImportedFile file = imported(brep, unit, "a.brep");
    near(file.parts.front().exact.volume_mm3, std::pow(20.0 * 25.4, 3.0), 1e-9);
  }
  SECTION("an extension that is unknown") {
    contains(rejection(step, {}, "a.stpe"), "unknown format '.stpe'; did you mean");
    contains(rejection(step, {}, "a.igs"), "export it as STEP");
  }
  SECTION("a file that is missing or no regular file") {
    ImportJob job;
    job.file = "/nonexistent.step";
    contains(rejection_message<ImportError>([&] { import_file(job); }), "no such file; check the name");
    const TemporaryDirectory dir;
    std::filesystem::create_directory(dir.path() / "d.step");
    job.file = dir.path() / "d.step";
    contains(rejection_message<ImportError>([&] { import_file(job); }), "directory");
  }
}

TEST_CASE("a solid that intersects itself is rejected with its place") {
  // The outline crosses itself: no plane face is bounded by it.
  BRepBuilderAPI_MakePolygon outline(gp_Pnt(0, 0, 0), gp_Pnt(10, 10, 0), gp_Pnt(10, 0, 0), gp_Pnt(0, 10, 0),
                                     true);
  BRep_Builder builder;
  TopoDS_Shell shell;
  builder.MakeShell(shell);
  builder.Add(shell, BRepBuilderAPI_MakeFace(outline.Wire(), true).Face());
  TopoDS_Solid solid;
  builder.MakeSolid(solid);
  builder.Add(solid, shell);
  ImportJob mm;
  mm.unit_mm = 1.0;
  const std::string message = rejection(brep_of(solid), mm, "a.brep");
  contains(message, "part 'part'");
  contains(message, "in the CAD program");
}

}  // namespace wrenchd::test_cad_import
