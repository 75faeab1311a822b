// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "config/load_scene.hpp"
#include "tests/support/run_program.hpp"
#include "tests/tools/import/sample_cad.hpp"

namespace wrenchd::test_import_program {

namespace {

namespace fs = std::filesystem;
using namespace test;

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void check_contains(const std::string& text, const std::string& part) {
  INFO(text << "\nlacks " << part);
  CHECK(text.find(part) != std::string::npos);
}

std::size_t files_in(const fs::path& directory) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(directory), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("wrenchd-import writes meshes that wrenchd accepts and that state their chord error") {
  const TemporaryDirectory dir;
  const std::string step = dir.write("part.step", step_of(plate_with_hole(), "INCH")).string();
  for (const char* extension : {"stl", "off", "ply", "obj"}) {
    const fs::path out = dir.path() / (std::string("part.") + extension);
    const ProgramResult result =
        run_program("wrenchd-import", {step, "-o", out.string(), "--chord", "0.02mm"});
    INFO(result.err << result.out);
    REQUIRE(result.exit_code == 0);
    CHECK(result.err == "");
    check_contains(result.out, "part.step: STEP, unit inch");
    check_contains(result.out, "chord error        at most 0.0");
    check_contains(result.out, "scale = 0.001");
    PolygonSoup soup = parse_mesh(read_mesh_source(out));
    const MeshReport report = repair_and_check_solid(soup);
    CHECK(report.solid());
    CHECK(report.repairs.empty());
    const std::string head = contents(out).substr(0, 200);
    check_contains(head, "unit mm, scale 0.001, chord error 0.0");
    CHECK_FALSE(head.starts_with("solid"));
  }
  CHECK(files_in(dir.path()) == 5);  // no temporary file
}

TEST_CASE("wrenchd-import leaves nothing behind after a failure, and keeps an older file") {
  const TemporaryDirectory dir;
  const std::string bad = dir.write("bad.step", "ISO-10303-21;\nnonsense").string();
  const fs::path old = dir.write("old.stl", "older content");
  const ProgramResult result = run_program("wrenchd-import", {bad, "-o", old.string()});
  CHECK(result.exit_code == 1);
  check_contains(result.err, "wrenchd-import: " + bad + ": is damaged or no STEP file");
  check_contains(result.err, "export it again");
  CHECK(contents(old) == "older content");
  CHECK(files_in(dir.path()) == 2);
}

TEST_CASE("wrenchd-import rejects invalid options with a remedy") {
  const TemporaryDirectory dir;
  const std::string step =
      dir.write("part.step", step_of(BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape())).string();
  const std::string obj = dir.write("a.obj", "v 0 0 0\n").string();
  struct {
    std::vector<std::string> arguments;
    std::string expected;
  } const table[] = {
      {{step, "--chord", "0.02"}, "--chord: '0.02' has no unit; did you mean 0.02mm?"},
      {{step, "--chord", "0mm"}, "--chord: 0mm is outside of 1e-6mm to 1m"},
      {{step, "--chord", "-1mm"}, "--chord: -1mm is outside of 1e-6mm to 1m"},
      {{step, "--chord", "1e-9mm"}, "--chord: 1e-9mm is outside of 1e-6mm to 1m"},
      {{step, "--chord", "nanmm"}, "is no length; write it as 0.02mm"},
      {{step, "--chord", "1 furlong"}, "has an unknown unit; use one of um, mm, cm, m, in, ft"},
      {{step, "--unit", "furlong"}, "--unit: unknown unit 'furlong'"},
      {{step, "-o", (dir.path() / "a.step").string()}, "name a .stl, .off, .ply or .obj file"},
      {{step, "-o", (dir.path() / "no/a.stl").string()}, "existing, writable directory"},
      {{step, "--joint", "a=1"}, "--joint belongs to URDF files"},
      {{step, "--package", "a=/tmp"}, "--package belongs to URDF files"},
      {{obj, "--unit", "mm", "--chord", "1mm"}, "--chord belongs to CAD files"},
      {{obj, "--unit", "mm", "--unite"}, "--unite belongs to CAD files"},
      {{obj, "--unit", "mm", "--skip-surfaces"}, "--skip-surfaces belongs to CAD files"},
  };
  for (const auto& [arguments, expected] : table) {
    const ProgramResult result = run_program("wrenchd-import", arguments);
    CHECK(result.exit_code == 1);
    check_contains(result.err, expected);
  }
  CHECK(files_in(dir.path()) == 2);
}

TEST_CASE("wrenchd-import writes a scene with the chord error as its tolerance") {
  const TemporaryDirectory dir;
  const std::string step =
      dir.write("a.step", step_of({{"ball", BRepPrimAPI_MakeSphere(20.0).Shape(), at(0, 0, 100)},
                                   {"bar / 1", BRepPrimAPI_MakeCylinder(5.0, 80.0).Shape()}}))
          .string();
  const fs::path scene = dir.path() / "out.toml";
  const ProgramResult result = run_program("wrenchd-import", {step, "-o", scene.string(), "--chord", "50um"});
  INFO(result.err << result.out);
  REQUIRE(result.exit_code == 0);
  const SceneSettings loaded = load_scene(scene);
  REQUIRE(loaded.meshes.size() == 2);
  CHECK(loaded.meshes[0].name == "ball");
  CHECK(loaded.meshes[1].name == "bar / 1");
  CHECK(loaded.meshes[0].scale == 0.001);
  CHECK(loaded.surface_tolerance_m <= 50e-6);
  CHECK(loaded.surface_tolerance_m > 10e-6);
  for (const MeshObstacleSettings& obstacle : loaded.meshes) {
    PolygonSoup soup = parse_mesh(read_mesh_source(obstacle.mesh));
    CHECK(repair_and_check_solid(soup).solid());
  }
  CHECK(files_in(dir.path()) == 4);
}

TEST_CASE("each remedy for solids that overlap works") {
  const TemporaryDirectory dir;
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape(),
                     other = BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape();
  const std::string step = dir.write("a.step", step_of({{"a", box}, {"b", other, at(5, 2, 1)}})).string();
  const std::string mesh = (dir.path() / "out.ply").string(), scene = (dir.path() / "out.toml").string();
  const ProgramResult rejected = run_program("wrenchd-import", {step, "-o", mesh});
  CHECK(rejected.exit_code == 1);
  check_contains(rejected.err, "parts 'a' and 'b' overlap by 360 mm^3");
  CHECK_FALSE(fs::exists(mesh));
  CHECK(run_program("wrenchd-import", {step, "-o", mesh, "--unite"}).exit_code == 0);
  PolygonSoup soup = parse_mesh(read_mesh_source(mesh));
  CHECK(repair_and_check_solid(soup).solid());
  CHECK(run_program("wrenchd-import", {step, "-o", mesh, "--part", "a"}).exit_code == 0);
  CHECK(run_program("wrenchd-import", {step, "-o", scene}).exit_code == 0);
  CHECK(load_scene(scene).meshes.size() == 2);
  CHECK(run_program("wrenchctl", {"check", scene}).exit_code == 0);
}

// Single precision moves the vertices of this ball by up to 2 um. The first run measures the error of the
// mesh that the second run, which may have no more, tries first.
TEST_CASE("meshing leaves room for single precision") {
  const TemporaryDirectory dir;
  const TopoDS_Shape ball = BRepPrimAPI_MakeSphere(50.0).Shape().Moved(at(5e4, 0, 0));
  const std::string step = dir.write("a.step", step_of(ball)).string();
  const auto import_to = [&](const char* name, const std::string& chord) {
    return run_program("wrenchd-import", {step, "-o", (dir.path() / name).string(), "--chord", chord});
  };
  const ProgramResult loose = import_to("out.ply", "0.55mm");
  INFO(loose.err << loose.out);
  REQUIRE(loose.exit_code == 0);
  const std::size_t at_most = loose.out.find("at most ") + 8;
  const std::string measured = loose.out.substr(at_most, loose.out.find(" mm", at_most) - at_most) + "mm";
  const ProgramResult tight = import_to("out.stl", measured);
  INFO(measured << ' ' << tight.err << tight.out);
  CHECK(tight.exit_code == 0);
}

TEST_CASE("a chord error that single precision does not keep is rejected") {
  const TemporaryDirectory dir;
  const TopoDS_Shape far = BRepPrimAPI_MakeSphere(5.0).Shape().Moved(at(1e6, 0, 0));
  const std::string step = dir.write("far.step", step_of(far)).string();
  const fs::path out = dir.path() / "far.stl";
  const ProgramResult result = run_program("wrenchd-import", {step, "-o", out.string()});
  CHECK(result.exit_code == 1);
  check_contains(result.err, "write a .off or .ply file, or use a coarser --chord");
  CHECK_FALSE(fs::exists(out));
  CHECK(run_program("wrenchd-import", {step, "-o", (dir.path() / "far.ply").string()}).exit_code == 0);
}

}  // namespace wrenchd::test_import_program
