// SPDX-License-Identifier: GPL-3.0-or-later
#include <clocale>
#include <locale>
#include <sstream>

#include <catch2/catch.hpp>

#include "config/pose_table.hpp"

namespace wrenchd::test_pose_table {

namespace {

const std::string kHeader = "px,py,pz,qx,qy,qz,qw\n";

std::vector<Pose> poses(const std::string& text) {
  std::istringstream in(text);
  return read_poses(in, "p.csv");
}

/// Returns the message with which the table is rejected; empty if it is read.
std::string rejection_text(const std::string& text) {
  try {
    poses(text);
  } catch (const PoseTableError& error) {
    return error.what();
  }
  return {};
}

void check_pose(const Pose& X, const Vector3d& p, const Quaterniond& q) {
  CHECK((X.translation_m - p).norm() == 0.0);
  CHECK((X.rotation.coeffs() - q.coeffs()).norm() < 1e-15);
}

TEST_CASE("a table returns its poses in file order, with the quaternion's scalar last") {
  const auto X = poses(kHeader + "1,2,3,0,0,0,1\n-0.5,0,1e-3,0.6,0,0,0.8\n0,0,0,0,0,-1,0\n");
  REQUIRE(X.size() == 3);
  check_pose(X[0], {1, 2, 3}, {1, 0, 0, 0});
  check_pose(X[1], {-0.5, 0, 0.001}, {0.8, 0.6, 0, 0});
  check_pose(X[2], {0, 0, 0}, {0, 0, 0, -1});
}

TEST_CASE("formats of all common spreadsheets are read") {
  const std::string row = "1.5,-2,3e2,0,0,0,1\n";
  const std::vector<std::string> good = {
      kHeader + row,
      kHeader + "1.5,-2,3e2,0,0,0,1",                              // no end of line
      "px,py,pz,qx,qy,qz,qw\r\n1.5,-2,3e2,0,0,0,1\r\n",            // Windows
      "\xEF\xBB\xBF" + kHeader + row,                              // byte order mark
      "\n \n" + kHeader + "\n\t\n" + row + "\n\r\n",               // blank lines
      " px, py ,pz,qx,qy,qz,qw \n 1.5,\t-2 , 3e2,0 ,0,0, 1 \n",    // blanks
      kHeader + "+1.5,-2.0e+0,3.E2,-0,0.0,.0,1.\n",                // notations of a number
      kHeader + "1.5,-2,300.00000000000000000000000000,0,0,0,1\n"  // more digits than a double has
  };
  for (const std::string& text : good) {
    INFO(text);
    CHECK(rejection_text(text) == "");
    const auto X = poses(text);
    REQUIRE(X.size() == 1);
    check_pose(X[0], {1.5, -2, 300}, {1, 0, 0, 0});
  }
}

TEST_CASE("a table without poses is valid") {
  CHECK(poses(kHeader).empty());
}

TEST_CASE("a quaternion of nearly unit norm is normalized") {
  const auto X = poses(kHeader + "0,0,0,0,0,0.707,0.707\n");
  REQUIRE(X.size() == 1);
  CHECK(X[0].rotation.norm() == Approx(1.0).epsilon(1e-15));
  CHECK(X[0].rotation.z() == Approx(std::sqrt(0.5)).epsilon(1e-15));
  CHECK(rejection_text(kHeader + "0,0,0,0,0,0,1.0009\n") == "");
  CHECK(rejection_text(kHeader + "0,0,0,0,0,0,0.9991\n") == "");
  CHECK(rejection_text(kHeader + "0,0,0,0,0,0,1.0011\n") != "");
  CHECK(rejection_text(kHeader + "0,0,0,0,0,0,0.9989\n") != "");
}

TEST_CASE("numbers have a decimal point in every locale") {
  struct CommaPoint : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
  };
  const std::string before = std::setlocale(LC_NUMERIC, nullptr);
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE"})
    if (std::setlocale(LC_NUMERIC, name) != nullptr) break;
  const std::locale global = std::locale::global(std::locale(std::locale(), new CommaPoint));
  const auto X = poses(kHeader + "1.5,0,0,0,0,0,1\n");
  const std::string message = rejection_text(kHeader + "1,5,0,0,0,0,0,1\n");
  std::locale::global(global);
  std::setlocale(LC_NUMERIC, before.c_str());
  REQUIRE(X.size() == 1);
  CHECK(X[0].translation_m.x() == 1.5);
  CHECK(message.find("p.csv:2:1: expected 7 numbers") == 0);
}

TEST_CASE("an invalid table is rejected with line, column and remedy") {
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"", "p.csv:1:1: is empty; expected the header 'px,py,pz,qx,qy,qz,qw'"},
      {"\n\n", "p.csv:1:1: is empty; expected the header 'px,py,pz,qx,qy,qz,qw'"},
      {"1,2,3,0,0,0,1\n", "p.csv:1:1: expected the header 'px,py,pz,qx,qy,qz,qw', found '1,2,3,0,0,0,1'"},
      {"\npx,py,pz,qw,qx,qy,qz\n",
       "p.csv:2:1: expected the header 'px,py,pz,qx,qy,qz,qw', found 'px,py,pz,qw,qx,qy,qz'"},
      {"PX,PY,PZ,QX,QY,QZ,QW\n",
       "p.csv:1:1: expected the header 'px,py,pz,qx,qy,qz,qw', found 'PX,PY,PZ,QX,QY,QZ,QW'"},
      {"px,py,pz\n", "p.csv:1:1: expected the header 'px,py,pz,qx,qy,qz,qw', found 'px,py,pz'"},
      {std::string("\x89PNG\r\n\x1a\n\0\0", 10),
       "p.csv:1:1: expected the header 'px,py,pz,qx,qy,qz,qw', found '\x89PNG'"},
      {std::string("p\0x\x1b[31m", 8),
       "p.csv:1:1: expected the header 'px,py,pz,qx,qy,qz,qw', found 'p?x?[31m'"},
      {kHeader + "1,2,3,0,0,0\n", "p.csv:2:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 6"},
      {kHeader + "1,2,3,0,0,0,1,\n", "p.csv:2:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 8"},
      {kHeader + "1 2 3 0 0 0 1\n",
       "p.csv:2:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 1; separate them with commas"},
      {kHeader + "1;2;3;0;0;0;1\n",
       "p.csv:2:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 1; separate them with commas"},
      {kHeader + "\n1,x,3,0,0,0,1\n", "p.csv:3:3: py must be a finite number, found 'x'"},
      {kHeader + "1,,3,0,0,0,1\n", "p.csv:2:3: py must be a finite number, found nothing"},
      {kHeader + "1, ,3,0,0,0,1\n", "p.csv:2:3: py must be a finite number, found nothing"},
      {kHeader + "nan,2,3,0,0,0,1\n", "p.csv:2:1: px must be a finite number, found 'nan'"},
      {kHeader + "1,2,-inf,0,0,0,1\n", "p.csv:2:5: pz must be a finite number, found '-inf'"},
      {kHeader + "1,2,3,0,0,0,1e999\n", "p.csv:2:13: qw must be a finite number, found '1e999'"},
      {kHeader + "1,2,3,0,0,0x1,1\n", "p.csv:2:11: qz must be a finite number, found '0x1'"},
      {kHeader + "1,2,3.5m,0,0,0,1\n", "p.csv:2:5: pz must be a finite number, found '3.5m'"},
      {kHeader + "1,--2,3,0,0,0,1\n", "p.csv:2:3: py must be a finite number, found '--2'"},
      {kHeader + "1,+-2,3,0,0,0,1\n", "p.csv:2:3: py must be a finite number, found '+-2'"},
      {kHeader + "1,+,3,0,0,0,1\n", "p.csv:2:3: py must be a finite number, found '+'"},
      {kHeader + "1,2,3,0,0,0,\"1\"\n", "p.csv:2:13: qw must be a finite number, found '\"1\"'"},
      {kHeader + "1,2,-1e10,0,0,0,1\n", "p.csv:2:5: pz is -1e+10, farther out than 1e9 m; give metres"},
      {kHeader + "1,2,3,0,0,0,0\n",
       "p.csv:2:7: the quaternion qx,qy,qz,qw has norm 0; it must be 1 (is the scalar last?)"},
      {kHeader + "1,2,3,1,1,1,1\n",
       "p.csv:2:7: the quaternion qx,qy,qz,qw has norm 2; it must be 1 (is the scalar last?)"},
      {kHeader + "1,2,3,1e200,0,0,0\n", "p.csv:2:7: the quaternion qx,qy,qz,qw has norm inf; it must be 1"},
      {kHeader + "# a comment\n",
       "p.csv:2:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 1; separate them"},
      {kHeader + kHeader, "p.csv:2:1: px must be a finite number, found 'px'"},
      {kHeader + "1,2,3,0,0,0,1\r1,2,3,0,0,0,1\r", "p.csv:2:1: expected 7 numbers"},
  };
  for (const auto& [text, expected] : bad) {
    const std::string message = rejection_text(text);
    INFO(text << "\nexpected " << expected << "\ngot " << message);
    CHECK(message.find(expected) == 0);
  }
}

TEST_CASE("times of poses are returned relative to the first", "[playback]") {
  std::istringstream in(
      "time_s,px,py,pz,qx,qy,qz,qw\n5,0,0,0,0,0,0,1\n5.01,0.001,0,0,0,0,0,1.0005\n\n5.5,0.02,0,0,0,0,1,0\n");
  CHECK_THROWS_WITH(read_timed_poses(in, "t.csv"), Catch::Contains("t.csv:5:1: a rotation of 3.14"));
  std::istringstream good(
      "time_s, "
      "px,py,pz,qx,qy,qz,qw\r\n5,0,0,0,0,0,0,1\n5.01,0.001,0,0,0,0,0,1.0005\n\n5.5,0.02,0,0,0,0,0.5,0."
      "8660254\n");
  const auto poses = read_timed_poses(good, "t.csv");
  REQUIRE(poses.size() == 3);
  CHECK(poses[0].time_s == 0.0);
  CHECK(poses[1].time_s == Approx(0.01));
  CHECK(poses[2].time_s == 0.5);
  CHECK(poses[1].X.rotation.norm() == Approx(1.0).epsilon(1e-12));
  CHECK(poses[2].X.translation_m.x() == 0.02);
}

TEST_CASE("implausible hand motions and tables without times are rejected with the line", "[playback]") {
  const std::string header = "time_s,px,py,pz,qx,qy,qz,qw\n", first = "0,0,0,0,0,0,0,1\n";
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"", "t.csv:1:1: is empty; expected the header 'time_s,px"},
      {header, "t.csv:1:1: has no poses"},
      {"px,py,pz,qx,qy,qz,qw\n", "t.csv:1:1: expected the header 'time_s,px,py,pz,qx,qy,qz,qw'"},
      {header + first + "0,0,0,0,0,0,0,1\n",
       "t.csv:3:1: time_s is 0, and 0 in the line before; times must ascend"},
      {header + first + "-1,0,0,0,0,0,0,1\n", "t.csv:3:1: time_s is -1, and 0 in the line before"},
      {header + first + "1.5,0,0,0,0,0,0,1\n", "t.csv:3:1: a gap of 1.5 s; give a pose at least every 1 s"},
      {header + first + "0.001,0.5,0,0,0,0,0,1\n", "t.csv:3:1: a jump of 0.5 m in 0.001 s"},
      {header + first + "nan,0,0,0,0,0,0,1\n", "t.csv:3:1: time_s must be a finite number, found 'nan'"},
      {header + first + "0.1,inf,0,0,0,0,0,1\n", "t.csv:3:5: px must be a finite number, found 'inf'"},
      {header + first + "0.1,0,0,0,0,0,0,2\n", "t.csv:3:11: the quaternion qx,qy,qz,qw has norm 2"},
      {header + first + "0.1,0,0,0,0,0,1\n", "t.csv:3:1: expected 8 numbers (time_s,px"},
      {"\x89HDF\r\n\x1a\n", "t.csv:1:1: expected the header"},
  };
  for (const auto& [text, expected] : bad) {
    std::istringstream in(text);
    std::string message = "nothing";
    try {
      read_timed_poses(in, "t.csv");
    } catch (const PoseTableError& error) {
      message = error.what();
    }
    INFO(text << "\nexpected " << expected << "\ngot " << message);
    CHECK(message.find(expected) == 0);
  }
}

TEST_CASE("all defects are reported together, up to ten lines") {
  CHECK(rejection_text(kHeader + "x,2,3,0,0,0,y\n1,2,3,0,0,0,1\n1,2\n") ==
        "p.csv:2:1: px must be a finite number, found 'x'\n"
        "p.csv:2:13: qw must be a finite number, found 'y'\n"
        "p.csv:4:1: expected 7 numbers (px,py,pz,qx,qy,qz,qw), found 2");
  std::string many = kHeader;
  for (int i = 0; i < 25; ++i) many += "oh\n";
  const std::string message = rejection_text(many);
  CHECK(std::count(message.begin(), message.end(), '\n') == 10);
  CHECK(message.find("p.csv:11:1: ") != std::string::npos);
  CHECK(message.find("p.csv:12:1: ") == std::string::npos);
  CHECK(message.find("\nand 15 more") != std::string::npos);
}

TEST_CASE("a message quotes only a short part of an invalid file") {
  CHECK(rejection_text(std::string(100000, 'x')).size() < 300);
  CHECK(rejection_text(kHeader + std::string(100000, 'x') + ",2,3,0,0,0,1\n").size() < 300);
}

}  // namespace
}  // namespace wrenchd::test_pose_table
