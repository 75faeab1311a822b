// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <string>

#include <catch2/catch.hpp>

#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/robot_import.hpp"

namespace wrenchd::test_robot_import {

namespace {

using namespace test;

/// An ASCII STL file of a tetrahedron with corners at the origin and at 1 on each axis.
constexpr const char* kTetrahedron = R"(solid t
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 1 0
vertex 1 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 0 1
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 1
vertex 0 1 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 1 0 0
vertex 0 1 0
vertex 0 0 1
endloop
endfacet
endsolid t
)";

/// A base, an arm that turns about y, a slider on it, and a finger that mimics the slider.
constexpr const char* kRobot = R"(<?xml version="1.0"?>
<robot name="r">
  <link name="base"><collision><geometry><box size="0.2 0.1 0.05"/></geometry></collision></link>
  <link name="arm">
    <collision><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></collision>
    <collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
  <link name="slider"><collision><geometry><mesh filename="package://robot/meshes/t.stl" scale="0.1 0.1 -0.1"/></geometry></collision></link>
  <link name="finger"><collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision></link>
  <link name="bare"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.025" rpy="0 0 1.5707963267948966"/><axis xyz="0 2 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="slider"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="grip" type="prismatic"><parent link="slider"/><child link="finger"/><axis xyz="1 0 0"/><mimic joint="slide" multiplier="-2" offset="0.01"/></joint>
  <joint name="fixed" type="fixed"><parent link="base"/><child link="bare"/></joint>
</robot>
)";

struct Robot {
  TemporaryDirectory dir;
  RobotJob job;

  explicit Robot(const std::string& urdf = kRobot) {
    job.job.file = dir.write("robot/urdf/r.urdf", urdf);
    dir.write("robot/meshes/t.stl", kTetrahedron);
  }
  std::vector<PlacedBody> bodies() {
    std::vector<std::string> remarks;
    return import_robot(job, remarks);
  }
  std::string rejection() {
    return rejection_message<ImportError>([&] { bodies(); });
  }
};

void check_contains(const std::string& text, const std::string& part) {
  INFO(text << "\nlacks " << part);
  CHECK(text.find(part) != std::string::npos);
}

void check_at(const PlacedBody& body, const Vector3d& expected) {
  INFO(body.name << " is at " << body.X_WM.translation_m.transpose() << ", not " << expected.transpose());
  CHECK((body.X_WM.translation_m - expected).norm() < 1e-12);
}

}  // namespace

TEST_CASE("the collision elements of a robot are bodies at their poses") {
  Robot robot;
  std::vector<std::string> remarks;
  const auto bodies = import_robot(robot.job, remarks);
  REQUIRE(bodies.size() == 5);
  CHECK(bodies[0].name == "base");
  CHECK(bodies[1].name == "arm");
  CHECK(bodies[2].name == "arm-2");
  CHECK(bodies[3].name == "slider");
  REQUIRE(remarks.size() == 1);
  check_contains(remarks.front(), "1 links have a visual, but no collision element");

  check_at(bodies[0], {0, 0, 0});
  check_at(bodies[1], {0, 0, 0.125});
  check_at(bodies[2], {0, 0, 0.225});
  check_at(bodies[3], {0, 0, 0.225});
  check_at(bodies[4], {0, 0.01, 0.225});  // the arm is turned by 90 degrees about z: its x is y

  CHECK(geometric_properties(bodies[0].body.mesh_mm).volume_mm3 == Approx(200.0 * 100.0 * 50.0));
  CHECK(bodies[1].body.exact.volume_mm3 == Approx(M_PI * 400.0 * 200.0));
  CHECK(bodies[1].body.chord_error_mm <= 0.02);
  CHECK(bodies[2].body.exact.volume_mm3 == Approx(4.0 / 3.0 * M_PI * 27000.0));
  const GeometricProperties mesh = geometric_properties(bodies[3].body.mesh_mm);
  CHECK(mesh.volume_mm3 == Approx(1e6 / 6.0));  // 100 mm, mirrored, facing outwards
  CHECK(mesh.centre_mm.z() == Approx(-25.0));
}

TEST_CASE("joints have the positions that are given, and mimic joints follow") {
  Robot robot;
  robot.job.joints = {"shoulder=1.5707963267948966", "slide=0.05"};
  const auto bodies = robot.bodies();
  // The arm's z points along its own x after the rotation about y, which is the base's y.
  check_at(bodies[3], {0, 0.25, 0.025});
  check_at(bodies[4], {0, 0.25, 0.025 + 0.09});  // -2 * 0.05 + 0.01 along the arm's x, which points down
}

TEST_CASE("a robot that cannot be imported is rejected with place and remedy") {
  const auto rejected = [](const std::string& from, const std::string& to) {
    return Robot(with(kRobot, from, to)).rejection();
  };
  check_contains(rejected("</robot>", ""), "is no XML");
  check_contains(rejected("<cylinder radius=\"0.02\" length=\"0.2\"/>", "<cone/>"),
                 "link 'arm', collision 1: its geometry is no mesh, box, cylinder or sphere");
  check_contains(rejected("radius=\"0.03\"", "radius=\"-1\""),
                 "link 'arm', collision 2: radius is not above 0");
  check_contains(rejected("<child link=\"arm\"/>", "<child link=\"leg\"/>"), "there is no link 'leg'");
  check_contains(rejected("<child link=\"bare\"/>", "<child link=\"arm\"/>"),
                 "is the child of another joint too");
  check_contains(rejected("type=\"fixed\"", "type=\"glued\""), "joint 'fixed': unknown type 'glued'");
  check_contains(rejected("0.2 0.1 0.05", "0.2 0.1"), "expected three numbers, found '0.2 0.1'");
  check_contains(rejected("package://robot/", "package://other/"),
                 "the directory of the package 'other' is unknown; name it with --package other=DIR");
  check_contains(rejected("package://robot/meshes/t.stl", "/etc/passwd"), "lies outside of the directories");
  check_contains(rejected("package://robot/meshes/t.stl", "package://robot/meshes/u.stl"), "no such file");

  Robot robot;
  robot.job.joints = {"sholder=1"};
  check_contains(robot.rejection(), "did you mean 'shoulder'?");
  robot.job.joints = {"shoulder=3"};
  check_contains(robot.rejection(), "3 is outside of -2 to 2 rad; choose a position within");
  robot.job.joints = {"shoulder"};
  check_contains(robot.rejection(), "write it as NAME=VALUE");
  robot.job.joints = {"grip=0.1"};
  check_contains(robot.rejection(), "no joint of this name can be set");
  robot.job.joints = {};
  robot.job.job.parts = {"leg"};
  check_contains(robot.rejection(), "has no link 'leg' with a collision element");
  robot.job.job.parts = {"arm"};
  CHECK(robot.bodies().size() == 2);
}

TEST_CASE("joints that form a ring are rejected") {
  const std::string ring =
      R"(<robot name="r"><link name="root"><collision><geometry><sphere radius="1"/></geometry></collision></link>
<link name="a"><collision><geometry><sphere radius="1"/></geometry></collision></link><link name="b"/>
<joint name="1" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="2" type="fixed"><parent link="b"/><child link="a"/></joint></robot>)";
  check_contains(Robot(ring).rejection(), "its joints form a ring");
}

}  // namespace wrenchd::test_robot_import
