// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <iostream>
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "core/inertia.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_mesh_file {

namespace {

namespace fs = std::filesystem;
using namespace test;

const PolygonSoup kBox = box({-1, 2, -3}, {4, 2.5, 1});

PolygonSoup read_file(const fs::path& file) {
  return parse_mesh(read_mesh_source(file));
}

/// Returns the message with which the file is rejected; empty if it is read. Nothing else may appear on the
/// standard streams.
std::string rejection_text(const fs::path& file) {
  std::ostringstream printed;
  std::streambuf* const out = std::cout.rdbuf(printed.rdbuf());
  std::streambuf* const err = std::cerr.rdbuf(printed.rdbuf());
  std::string message;
  try {
    read_file(file);
  } catch (const MeshError& error) {
    message = error.what();
  }
  std::cout.rdbuf(out);
  std::cerr.rdbuf(err);
  CHECK(printed.str() == "");
  return message;
}

void check_is_the_box(const fs::path& file) {
  INFO(file);
  TriangleMesh mesh;
  const MeshReport report = check_solid(read_file(file), &mesh);
  REQUIRE(report.solid());
  CHECK(report.vertices == 8);
  CHECK(mesh.triangles.size() == 12);
  const SolidProperties solid = solid_properties(mesh, 6.0);
  CHECK(solid.volume_m3 == Approx(5 * 0.5 * 4).epsilon(1e-12));
  CHECK((solid.p_MT_m - Vector3d(1.5, 2.25, -1)).norm() < 1e-12);
  // m/12 (b^2 + c^2)
  const Matrix3d H = Vector3d(0.125 + 8, 12.5 + 8, 12.5 + 0.125).asDiagonal();
  CHECK((solid.inertia.H_kg_m2 - H).norm() < 1e-11);
}

TEST_CASE("every format gives the same solid") {
  const TemporaryDirectory dir;
  const PolygonSoup triangles = triangulated(kBox);
  check_is_the_box(dir.write("quads.off", as_off(kBox)));
  check_is_the_box(dir.write("triangles.off", as_off(triangles)));
  check_is_the_box(dir.write("quads.obj", as_obj(kBox)));
  check_is_the_box(dir.write("triangles.obj", as_obj(triangles)));
  check_is_the_box(dir.write("ascii.stl", as_ascii_stl(triangles)));
  check_is_the_box(dir.write("binary.stl", as_binary_stl(triangles)));
  check_is_the_box(dir.write("ascii.ply", as_ascii_ply(kBox)));
  check_is_the_box(dir.write("little.ply", as_binary_ply(kBox)));
  check_is_the_box(dir.write("big.ply", as_binary_ply(triangles, true)));
  check_is_the_box(dir.write("UPPER.OFF", as_off(kBox)));
  check_is_the_box(dir.write("Mixed.Stl", as_binary_stl(triangles)));
}

std::string with_crlf(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\n' ? std::string("\r\n") : std::string(1, c);
  return out;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

TEST_CASE("additional data of exporters is ignored") {
  const TemporaryDirectory dir;
  const PolygonSoup triangles = triangulated(kBox);
  const std::string off = as_off(kBox);

  check_is_the_box(dir.write("crlf.off", with_crlf(off)));
  check_is_the_box(dir.write("crlf.obj", with_crlf(as_obj(kBox))));
  check_is_the_box(dir.write("crlf.stl", with_crlf(as_ascii_stl(triangles))));
  check_is_the_box(dir.write("crlf.ply", with_crlf(as_ascii_ply(kBox))));
  check_is_the_box(dir.write("comments.off", replaced(off, "OFF\n", "OFF # a box\n\n# 8 corners\n")));
  check_is_the_box(dir.write("one_line.off", replaced(off, "OFF\n", "OFF ")));
  check_is_the_box(dir.write("face_colour.off", replaced(off, "4 0 4 6 2\n", "4 0 4 6 2 255 0 0\n")));
  check_is_the_box(dir.write("plus.off", replaced(off, "\n4 2 ", "\n+4.0e0 2 ")));

  std::string coloured = replaced(off, "OFF", "COFF");
  for (std::size_t at = coloured.find('\n', 6);
       (at = coloured.find('\n', at + 1)) < coloured.find("\n4 0 4 6 2");)
    coloured.insert(at, " 10 20 30 255"), at += 13;
  coloured.insert(coloured.find("\n4 0 4 6 2"), " 10 20 30 255");
  check_is_the_box(dir.write("vertex_colours.off", coloured));

  std::string obj = as_obj(kBox);
  check_is_the_box(
      dir.write("materials.obj", "mtllib a.mtl\nvn 0 0 1\nvt 0 0\nl 1 2\n" + obj + "usemtl x\ns off\n"));
  check_is_the_box(dir.write("normals.obj", replaced(obj, "f 1 5 7 3", "f 1/1/1 5/1/1 7/1/1 3//1")));
  check_is_the_box(dir.write("relative.obj", replaced(obj, "f 1 5 7 3", "f -8 -4 -2 -6")));
  std::replace(obj.begin(), obj.end(), ' ', '\t');
  check_is_the_box(dir.write("tabs.obj", obj));

  check_is_the_box(
      dir.write("solid.stl", as_binary_stl(triangles, "solid by an exporter that knows no better")));
  check_is_the_box(dir.write("ints.ply", ply_header(kBox, "ascii", "float", "int int") + ply_body(kBox)));
  std::string ply = replaced(as_ascii_ply(kBox), "end_header",
                             "element edge 1\nproperty int a\nproperty uchar b\nend_header");
  check_is_the_box(dir.write("edges.ply", ply + "7 255\n"));
  check_is_the_box(dir.write("named.ply", replaced(as_binary_ply(kBox), "vertex_indices", "vertex_index")));
}

TEST_CASE("variants of exporters are read") {
  const TemporaryDirectory dir;
  const PolygonSoup triangles = triangulated(kBox);
  const std::string mark = "\xef\xbb\xbf";
  check_is_the_box(dir.write("mark.off", mark + as_off(kBox)));
  check_is_the_box(dir.write("mark.obj", mark + as_obj(kBox)));
  check_is_the_box(dir.write("mark.stl", mark + as_ascii_stl(triangles)));
  check_is_the_box(dir.write("glued.off", replaced(as_off(kBox), "OFF\n", "OFF")));
  check_is_the_box(dir.write("joined.obj", replaced(as_obj(kBox), "f 1 5 7 3", "f 1 5 \\\n 7 3")));
  check_is_the_box(
      dir.write("joined_crlf.obj", with_crlf(replaced(as_obj(kBox), "f 1 5 7 3", "f 1 5 \\\n7 3"))));
  check_is_the_box(dir.write("slashes.obj", replaced(as_obj(kBox), "f 1 5 7 3", "f 1// 5/ 7/2/ 3")));
  check_is_the_box(dir.write("coloured.obj", replaced(as_obj(kBox), "v 4 2 -3", "v 4 2 -3 0.5 0.5 1")));

  std::string stl = as_ascii_stl(triangles);
  check_is_the_box(dir.write("normals.stl", replaced(stl, "normal 0 0 0", "normal nan -nan(ind) 1e99")));
  check_is_the_box(dir.write("name.stl", replaced(stl, "solid box", "solid a facet of the vertex 1 2")));
  check_is_the_box(dir.write("no_name.stl", replaced(stl, "solid box", "solid")));
  std::string upper = stl;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  check_is_the_box(dir.write("upper.stl", upper));
  std::string blanks = stl;
  std::replace(blanks.begin() + 10, blanks.end() - 13, '\n', '\t');
  check_is_the_box(dir.write("one_line.stl", blanks));
  const std::size_t half = stl.find(" facet", stl.size() / 2);
  check_is_the_box(
      dir.write("two_solids.stl", stl.substr(0, half) + "endsolid a\n\nsolid b\n" + stl.substr(half)));

  const std::string binary = as_binary_ply(kBox);
  const std::size_t body = binary.find("end_header\n") + 11;
  check_is_the_box(dir.write("header.ply", with_crlf(binary.substr(0, body)) + binary.substr(body)));
  std::string more =
      replaced(as_ascii_ply(kBox), "property double z\n",
               "property double z\nproperty float nx\nproperty uchar red\nproperty uchar green\n"
               "property uchar blue\n");
  for (std::size_t at = more.find("end_header\n") + 11, v = 0; v < 8; ++v) {
    at = more.find('\n', at);
    more.insert(at, " 0.5 1 2 3");
    at = more.find('\n', at) + 1;
  }
  check_is_the_box(dir.write("more.ply", more));
  check_is_the_box(dir.write("more_crlf.ply", with_crlf(more)));
}

TEST_CASE("STL vertices are merged where they are equal") {
  const TemporaryDirectory dir;
  const PolygonSoup soup = read_file(dir.write("a.stl", as_binary_stl(triangulated(kBox))));
  CHECK(soup.vertices.size() == 8);
  CHECK(soup.faces.size() == 12);
}

/// A file, the place of its defect, and a part of the message.
struct Bad {
  std::string name;
  std::string bytes;
  std::string place;  ///< behind the file's name: ":LINE", or nothing
  std::string cure;
};

void check_refused(const std::vector<Bad>& table) {
  const TemporaryDirectory dir;
  for (const Bad& bad : table) {
    const fs::path file = dir.write(bad.name, bad.bytes);
    const auto start = std::chrono::steady_clock::now();
    const std::string message = rejection_text(file);
    INFO(bad.name << " " << bad.place << " ... " << bad.cure << "\ngot " << message);
    CHECK(message.find(file.string() + bad.place + ": ") == 0);
    CHECK(message.find(bad.cure) != std::string::npos);
    CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(5));
  }
}

TEST_CASE("a file that is no mesh is rejected with its name and a remedy") {
  const TemporaryDirectory dir;
  CHECK(rejection_text(dir.path() / "missing.off") ==
        (dir.path() / "missing.off").string() + ": no such file; check the path");
  fs::create_directory(dir.path() / "folder.off");
  CHECK(rejection_text(dir.path() / "folder.off").find("is a directory; name a file in it") !=
        std::string::npos);
  CHECK(rejection_text("").find("no such file") != std::string::npos);
  const std::string off = as_off(kBox);
  check_refused({
      {"empty.off", "", "", "is empty; export"},
      {"empty.stl", "", "", "is empty; export"},
      {"box.step", off, "", "unknown mesh format '.step'; save it as .off, .obj, .stl or .ply"},
      {"box", off, "", "unknown mesh format ''; save it as"},
      {"blank.off", "\n \n# nothing\n", "", "contains no mesh"},
      {"blank.obj", "\n \n# nothing\n", "", "has no faces"},
  });
}

TEST_CASE("a wrong extension is rejected") {
  const PolygonSoup triangles = triangulated(kBox);
  check_refused({
      {"stl.off", as_ascii_stl(triangles), ":1", "expected OFF"},
      {"ply.off", as_ascii_ply(kBox), ":1", "expected OFF"},
      {"off.obj", as_off(kBox), ":1", "'OFF' is no statement of an OBJ file"},
      {"binary_stl.obj", as_binary_stl(triangles, "\x01\x02"), ":1", "no statement of an OBJ file"},
      {"off.ply", as_off(kBox), ":1", "expected 'ply', found 'OFF'"},
      {"off.stl", as_off(kBox), "", "does not begin with 'solid'"},
      {"short.stl", "OFF\n", "", "is too short for an STL file"},
      {"ply.stl", as_binary_ply(triangles), "", "does not begin with 'solid'"},
  });
}

TEST_CASE("the faces of an OFF file may occupy several lines") {
  const TemporaryDirectory dir;
  const std::string off = as_off(kBox);
  check_is_the_box(dir.write("faces.off", replaced(replaced(off, "4 0 4 6 2", "4\n0 4\n6 2"), "4 1 3 7 5",
                                                   "4 1 3 7\n# a comment\n\n5 0.1 0.2 0.3")));
  const fs::path bad = dir.write("index.off", replaced(off, "4 0 4 6 2", "4 0\n4 6 9"));
  CHECK(rejection_text(bad).find(bad.string() + ":11: face 0: there is no vertex '9'") == 0);
}

/// The cube from (0, 0, 0) to (1, 1, 1) as one strip of 14 vertices.
std::string strip_cube(const std::string& format, const std::string& lists) {
  return "ply\nformat " + format +
         " 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\n"
         "property list " +
         lists + " vertex_indices\nend_header\n";
}
const std::vector<std::int32_t> kStrip = {0, 1, 4, 5, 7, 1, 3, 0, 2, 4, 6, 7, 2, 3};

TEST_CASE("PLY triangle strips are read, as text and binary") {
  const TemporaryDirectory dir;
  std::string text = strip_cube("ascii", "int int"), binary = strip_cube("binary_little_endian", "int int");
  for (unsigned v = 0; v < 8; ++v) {
    const float p[3] = {(v & 1U) ? 1.0F : 0.0F, (v & 2U) ? 1.0F : 0.0F, (v & 4U) ? 1.0F : 0.0F};
    for (const float x : p) append_bytes(binary, x);
    text += point_text({p[0], p[1], p[2]}) + "\n";
  }
  // Two strips: the second one repeats the last two vertices of the first.
  std::vector<std::int32_t> two(kStrip.begin(), kStrip.begin() + 4);
  two.push_back(-1);
  two.insert(two.end(), kStrip.begin() + 2, kStrip.end());
  for (const std::vector<std::int32_t>& strip : {kStrip, two}) {
    std::string as_text = text + std::to_string(strip.size()), as_binary = binary;
    append_bytes(as_binary, static_cast<std::int32_t>(strip.size()));
    for (const std::int32_t v : strip) {
      as_text += " " + std::to_string(v);
      append_bytes(as_binary, v);
    }
    for (const std::string& bytes : {as_text + "\n", as_binary}) {
      const PolygonSoup soup = read_file(dir.write("strip.ply", bytes));
      CHECK(soup.faces.size() == 12);
      const MeshReport report = check_solid(soup);
      INFO((report.defects.empty() ? "" : report.defects[0]));
      CHECK(report.solid());
      CHECK(report.volume == Approx(1.0));
    }
  }
}

TEST_CASE("invalid OFF files are rejected with the line") {
  const std::string off = as_off(kBox);
  const auto with = [&](const std::string& from, const std::string& to) { return replaced(off, from, to); };
  check_refused({
      {"cut.off", off.substr(0, off.size() - 10), "", "ends before face 5 of 6"},
      {"cut_vertices.off", off.substr(0, 38), ":6", "vertex 3: expected 3 numbers, found 2"},
      {"cut_number.off", off.substr(0, off.size() - 3), ":16", "corners declared, 3 numbers follow"},
      {"header_only.off", "OFF\n", ":1", "three counts"},
      {"vertices.off", with("8 6 0", "4000000000 6 0"), ":2",
       "declares 4000000000 vertices and 6 faces, more than the file can hold"},
      {"many.off", with("8 6 0", "2000000000 6 0"), ":2", "more than the file can hold; correct the counts"},
      {"faces.off", with("8 6 0", "8 2000000000 0"), ":2", "more than the file can hold; correct the counts"},
      {"negative.off", with("8 6 0", "-8 6 0"), ":2", "expected a count, found '-8'"},
      {"fraction.off", with("8 6 0", "8.5 6 0"), ":2", "expected a count, found '8.5'"},
      {"two_counts.off", with("8 6 0", "8 6"), ":2", "three counts"},
      {"too_few_faces.off", with("8 6 0", "8 5 0"), ":16", "more lines than the counts declare"},
      {"too_many_faces.off", with("8 6 0", "8 7 0"), "", "ends before face 6 of 7"},
      {"too_few_vertices.off", with("8 6 0", "7 6 0"), ":10", "face 0: "},
      {"too_many_vertices.off", with("8 6 0", "9 6 0"), "", "ends before face 5 of 6"},
      {"no_faces.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "",
       "has no faces; a tool needs a closed surface"},
      {"nothing.off", "OFF\n0 0 0\n", "", "has no faces; a tool needs a closed surface"},
      {"nan.off", with("\n4 2 -3", "\n4 nan -3"), ":4", "vertex 1: expected a finite number, found 'nan'"},
      {"inf.off", with("\n4 2 -3", "\n4 -inf -3"), ":4", "vertex 1: expected a finite number, found '-inf'"},
      {"huge.off", with("\n4 2 -3", "\n4 1e999 -3"), ":4",
       "vertex 1: expected a finite number, found '1e999'"},
      {"comma.off", with("\n4 2 -3", "\n4,2,-3"), ":4", "vertex 1: expected 3 numbers, found 1"},
      {"flat.off", with("\n4 2 -3", "\n4 2"), ":4", "vertex 1: expected 3 numbers, found 2"},
      {"index.off", with("4 0 4 6 2", "4 0 8 6 2"), ":11", "face 0: there is no vertex '8'"},
      {"negative_index.off", with("4 0 4 6 2", "4 0 -4 6 2"), ":11", "face 0: there is no vertex '-4'"},
      {"fraction_index.off", with("4 0 4 6 2", "4 0 4.5 6 2"), ":11", "face 0: there is no vertex '4.5'"},
      {"corners.off", with("4 0 4 6 2", "4000000000 0 4 6 2"), ":11",
       "face 0: '4000000000' corners declared"},
      {"negative_corners.off", with("4 0 4 6 2", "-4 0 4 6 2"), ":11", "face 0: '-4' corners declared"},
      {"binary.off", std::string("OFF BINARY\n\0\0\0\x8\0\0\0\x6\0\0\0\0", 23), ":1",
       "save the mesh as ASCII OFF"},
      {"textures.off", with("OFF", "STOFF"), ":1", "expected OFF (or COFF, NOFF, CNOFF), found 'STOFF'"},
      {"skel.off", with("OFF", "SKEL"), ":1", "save the mesh as a plain OFF"},
      {"colour.off", replaced(with("OFF", "COFF"), "\n4 2 -3\n", "\n4 2 -3 -7\n"), ":4",
       "save without colours"},
      {"normals.off", with("OFF", "NOFF"), ":3", "vertex 0: expected 6 numbers, found 3"},
  });
}

TEST_CASE("invalid OBJ files are rejected with the line") {
  const std::string obj = as_obj(kBox);
  const auto with = [&](const std::string& from, const std::string& to) { return replaced(obj, from, to); };
  check_refused({
      {"vertex.obj", with("v 4 2 -3", "v 4 2"), ":4", "vertex 1: expected 3 numbers, found 2"},
      {"nan.obj", with("v 4 2 -3", "v 4 2 NaN"), ":4", "vertex 1: expected a finite number, found 'NaN'"},
      {"zero.obj", with("f 1 5 7 3", "f 0 5 7 3"), ":11",
       "face 0: there is no vertex '0'; there are 8, numbered from 1"},
      {"nine.obj", with("f 1 5 7 3", "f 9 5 7 3"), ":11", "face 0: there is no vertex '9'"},
      {"before.obj", with("f 1 5 7 3", "f -9 5 7 3"), ":11", "face 0: there is no vertex '-9'"},
      {"huge.obj", with("f 1 5 7 3", "f 99999999999 5 7 3"), ":11", "there is no vertex '99999999999'"},
      {"overflow.obj", with("f 1 5 7 3", "f 99999999999999999999999 5 7 3"), ":11", "there is no vertex"},
      {"word.obj", with("f 1 5 7 3", "f 1 5 7 3 x"), ":11", "there is no vertex 'x'"},
      {"cut.obj", obj.substr(0, 18), ":3", "vertex 0: expected 3 numbers, found 2"},
      {"no_faces.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "", "has no faces"},
      {"no_vertices.obj", "f 1 2 3\n", ":1", "there is no vertex '1'"},
      {"text.obj", "this is a letter to my aunt\n", "", "has no faces"},
      {"Text.obj", "Dear aunt,\n", ":1", "'Dear' is no statement of an OBJ file"},
  });
}

TEST_CASE("invalid STL files are rejected") {
  const PolygonSoup triangles = triangulated(kBox);
  const std::string ascii = as_ascii_stl(triangles), binary = as_binary_stl(triangles);
  std::string counted = binary, nan = binary;
  const std::uint32_t many = 4000000000;
  std::memcpy(counted.data() + 80, &many, 4);
  const float no_number = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(nan.data() + 84 + 50 * 2 + 4 * 7, &no_number, 4);
  check_refused({
      {"cut_ascii.stl", ascii.substr(0, ascii.size() / 2), "",
       "ends before 'endsolid'; the file is truncated"},
      {"no_end.stl", ascii.substr(0, ascii.size() - 13), "", "ends before 'endsolid'; the file is truncated"},
      {"cut_binary.stl", binary.substr(0, binary.size() - 1), "", "has 684 bytes, not 683: it is truncated"},
      {"count.stl", counted, "", "a binary STL file of 4000000000 triangles has 200000000084 bytes, not 684"},
      {"overlong.stl", binary + binary.substr(84), "", "not 1284"},
      {"nan_binary.stl", nan, "", "face 2: corner 1 is not a finite number"},
      {"nan_ascii.stl", replaced(ascii, "vertex -1 ", "vertex nan "), ":4",
       "expected three finite numbers, found 'nan'"},
      {"two.stl", replaced(ascii, "vertex -1 2 -3", "vertex -1 2"), ":5",
       "expected three finite numbers, found 'vertex'"},
      {"four.stl", replaced(ascii, "   vertex -1 2 -3\n", "   vertex -1 2 -3\n   vertex 0 0 0\n"), ":9",
       "facet 0 has 4 vertices, not three"},
      {"word.stl", replaced(ascii, "endloop", "endlop"), ":7", "'endlop' is no word of an STL file"},
      {"no_triangles.stl", "solid nothing\nendsolid nothing\n", "", "has no faces"},
      {"no_triangles_binary.stl", binary.substr(0, 80) + std::string(4, '\0'), "", "has no faces"},
  });
}

TEST_CASE("invalid PLY files are rejected") {
  const std::string ply = as_ascii_ply(kBox), binary = as_binary_ply(kBox);
  const auto with = [&](const std::string& from, const std::string& to) { return replaced(ply, from, to); };
  const std::string start = "ply\nformat ascii 1.0\n";
  check_refused({
      {"signature.ply", "play\n", ":1", "expected 'ply', found 'play'"},
      {"format.ply", with("format ascii 1.0", "format binary 1.0"), ":2", "expected 'format ascii 1.0'"},
      {"header.ply", ply.substr(0, 60), ":5", "export the mesh again"},
      {"no_end.ply", with("end_header\n", ""), ":10", "is no line of a PLY header"},
      {"orphan.ply", start + "property float x\nend_header\n", ":3", "below an element"},
      {"type.ply", with("double y", "real y"), ":6", "'real' is no type of PLY"},
      {"count.ply", with("vertex 8", "vertex eight"), ":4", "expected 'element NAME COUNT'"},
      {"negative.ply", with("vertex 8", "vertex -8"), ":4", "expected 'element NAME COUNT'"},
      {"many.ply", with("vertex 8", "vertex 4000000000"), "", "vertex 18 of 4000000000 is truncated"},
      {"many_faces.ply", with("face 6", "face 4000000000"), "", "face 6 of 4000000000 is truncated"},
      {"hollow.ply", start + "element vertex 400000000000\nend_header\n", "",
       "element 'vertex' has no properties"},
      {"hollow_other.ply", start + "element foo 40000000000000\nend_header\n", "",
       "element 'foo' has no properties"},
      {"few.ply", with("face 6", "face 5"), "",
       "continues behind the elements that its header declares; correct the counts"},
      {"integers.ply", with("double y", "int y"), "", "needs a property 'y' of type float or double"},
      {"no_z.ply", with("property double z\n", ""), "", "needs a property 'z'"},
      {"no_list.ply", with("property list uchar int vertex_indices", "property int vertex_indices"), "",
       "needs a property list 'vertex_indices'"},
      {"list_type.ply", with("uchar int", "uchar uchar"), "",
       "needs a property list 'vertex_indices' of type int"},
      {"list_length.ply", with("uchar int", "float int"), ":9", "the length of a list cannot be a float"},
      {"long_list.ply", replaced(with("uchar int", "uint int"), "\n4 0 4 6 2", "\n4000000000 0 4 6 2"), "",
       "face 0 of 6 is truncated"},
      {"negative_list.ply", replaced(with("uchar int", "int int"), "\n4 0 4 6 2", "\n-4 0 4 6 2"), "",
       "face 0 of 6"},
      {"byte_list.ply", replaced(ply, "\n4 0 4 6 2", "\n260 0 4 6 2"), "", "face 0 of 6"},
      {"fraction.ply", replaced(ply, "\n4 0 4 6 2", "\n4 0 4.5 6 2"), "", "face 0 of 6"},
      {"nan.ply", replaced(ply, "\n4 2 -3\n", "\n4 nan -3\n"), "",
       "vertex 1 of 8 is truncated, or its 'y' is no number"},
      {"cut.ply", ply.substr(0, ply.size() - 3), "", "face 5 of 6 is truncated"},
      {"cut_binary.ply", binary.substr(0, binary.size() - 1), "", "face 5 of 6 is truncated"},
      {"long_binary.ply", binary + "x", "", "continues behind the elements"},
      {"halfedges.ply", with("end_header", "element halfedge 0\nproperty int source\nend_header"), "",
       "save the mesh with vertices and faces only"},
      {"colours.ply",
       with("property double z\n",
            "property double z\nproperty uchar red\nproperty uchar g\nproperty float green\n"
            "property uchar blue\n"),
       "", "the colours of element 'vertex' differ in type"},
      {"no_faces.ply",
       start + "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
       "", "has no faces"},
      {"header_only.ply", start + "end_header\n", "", "has no faces"},
  });
}

TEST_CASE("noise in any format is rejected without a crash") {
  const TemporaryDirectory dir;
  std::mt19937 random(7);
  for (const char* name : {"noise.off", "noise.obj", "noise.stl", "noise.ply"}) {
    for (int i = 0; i < 50; ++i) {
      std::string bytes(1 + random() % 3000, '\0');
      for (char& c : bytes) c = static_cast<char>(random() % 256);
      INFO(name << " " << i);
      CHECK(rejection_text(dir.write(name, bytes)).find("noise") != std::string::npos);
    }
  }
}

TEST_CASE("a valid file with modified bytes is read or rejected without a crash") {
  const TemporaryDirectory dir;
  const PolygonSoup triangles = triangulated(kBox);
  const std::pair<const char*, std::string> good[] = {{"a.off", as_off(kBox)},
                                                      {"a.obj", as_obj(kBox)},
                                                      {"a.stl", as_ascii_stl(triangles)},
                                                      {"b.stl", as_binary_stl(triangles)},
                                                      {"a.ply", as_ascii_ply(kBox)},
                                                      {"b.ply", as_binary_ply(kBox)}};
  const std::string spoilers("\0\xff 09-.e\n#x/", 13);
  std::mt19937 random(11);
  for (const auto& [name, text] : good) {
    for (int i = 0; i < 400; ++i) {
      std::string bytes = text;
      for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = spoilers[random() % spoilers.size()];
      if (random() % 4 == 0) bytes.resize(random() % bytes.size());
      const fs::path file = dir.write(name, bytes);
      try {
        TriangleMesh mesh;
        const MeshReport report = check_solid(read_file(file), &mesh);
        CHECK((report.solid() || !report.defects.empty()));
      } catch (const MeshError& error) {
        CHECK(std::string(error.what()).find(file.string()) == 0);
      }
    }
  }
}

}  // namespace
}  // namespace wrenchd::test_mesh_file
