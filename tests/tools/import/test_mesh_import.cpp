// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include <zlib.h>

#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/import_file.hpp"
#include "tools/import/imported_body.hpp"

namespace wrenchd::test_mesh_import {

namespace {

using namespace test;

/// The corners and triangles of a box with one corner at the origin.
const std::array<std::array<int, 3>, 8> kCorners = {
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
const std::array<std::array<int, 3>, 12> kTriangles = {{{0, 2, 1},
                                                        {0, 3, 2},
                                                        {4, 5, 6},
                                                        {4, 6, 7},
                                                        {0, 1, 5},
                                                        {0, 5, 4},
                                                        {1, 2, 6},
                                                        {1, 6, 5},
                                                        {2, 3, 7},
                                                        {2, 7, 6},
                                                        {3, 0, 4},
                                                        {3, 4, 7}}};
/// The sides of the box of the tests, in units of the file. Single precision holds them.
const Vector3d kSides(2.0, 3.0, 0.5);

template <class T>
void append(std::string& bytes, T x) {
  bytes.append(reinterpret_cast<const char*>(&x), sizeof x);
}

std::string base64(const std::string& bytes) {
  static const char* const letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t n = 0;
    for (std::size_t k = 0; k < 3; ++k)
      n = n << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? letters[n >> (18 - 6 * k) & 63U] : '=';
  }
  return text;
}

std::string gltf_buffer() {
  std::string bytes;
  for (const auto& p : kCorners)
    for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(p[static_cast<std::size_t>(k)] * kSides[k]));
  for (const auto& t : kTriangles)
    for (const int v : t) append(bytes, static_cast<std::uint16_t>(v));
  return bytes;
}

/// A glTF file with one box. node: further members of its node.
std::string gltf(const std::string& uri, const std::string& node = "") {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"name":"box")" +
         node +
         R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"buffers":[{"uri":")" +
         uri +
         R"(","byteLength":168}],"bufferViews":[{"buffer":0,"byteLength":96,"target":34962},)"
         R"({"buffer":0,"byteOffset":96,"byteLength":72,"target":34963}],"accessors":[)"
         R"({"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[2,3,0.5]},)"
         R"({"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}]})";
}

std::string inline_gltf(const std::string& node = "") {
  return gltf("data:application/octet-stream;base64," + base64(gltf_buffer()), node);
}

std::string obj(const std::vector<std::pair<std::string, double>>& groups) {
  std::string text;
  int first = 1;
  for (const auto& [name, x] : groups) {
    text += "g " + name + "\n";
    for (const auto& p : kCorners)
      text += "v " + std::to_string(p[0] * kSides.x() + x) + " " + std::to_string(p[1] * kSides.y()) + " " +
              std::to_string(p[2] * kSides.z()) + "\n";
    for (const auto& t : kTriangles)
      text += "f " + std::to_string(t[0] + first) + " " + std::to_string(t[1] + first) + " " +
              std::to_string(t[2] + first) + "\n";
    first += 8;
  }
  return text;
}

std::string collada(const std::string& unit) {
  std::string positions, triangles;
  for (const auto& p : kCorners)
    for (int k = 0; k < 3; ++k) positions += std::to_string(p[static_cast<std::size_t>(k)] * kSides[k]) + " ";
  for (const auto& t : kTriangles)
    for (const int v : t) triangles += std::to_string(v) + " ";
  return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>)" +
         unit + R"(<up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g" name="g"><mesh>
<source id="p"><float_array id="pa" count="24">)" +
         positions + R"(</float_array><technique_common>
<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>)" +
         triangles + R"(</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n" name="box"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";
}

/// A zip archive of files that are not compressed.
std::string zip(const std::vector<std::pair<std::string, std::string>>& files) {
  std::string out, directory;
  for (const auto& [name, content] : files) {
    const auto offset = static_cast<std::uint32_t>(out.size());
    const auto size = static_cast<std::uint32_t>(content.size());
    const auto crc = static_cast<std::uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size())));
    const auto header = [&](std::string& to, bool central) {
      append(to, std::uint32_t{central ? 0x02014b50U : 0x04034b50U});
      if (central) append(to, std::uint16_t{20});
      for (const int x : {20, 0, 0, 0, 0}) append(to, static_cast<std::uint16_t>(x));
      for (const std::uint32_t x : {crc, size, size}) append(to, x);
      append(to, static_cast<std::uint16_t>(name.size()));
      append(to, std::uint16_t{0});
      if (central) {
        for (int i = 0; i < 3; ++i) append(to, std::uint16_t{0});
        append(to, std::uint32_t{0});
        append(to, offset);
      }
      to += name;
    };
    header(out, false);
    out += content;
    header(directory, true);
  }
  const auto start = static_cast<std::uint32_t>(out.size());
  out += directory;
  append(out, std::uint32_t{0x06054b50});
  for (int i = 0; i < 2; ++i) append(out, std::uint16_t{0});
  for (int i = 0; i < 2; ++i) append(out, static_cast<std::uint16_t>(files.size()));
  append(out, static_cast<std::uint32_t>(directory.size()));
  append(out, start);
  append(out, std::uint16_t{0});
  return out;
}

std::string threemf(const std::string& unit) {
  std::string vertices, triangles;
  for (const auto& p : kCorners)
    vertices += "<vertex x=\"" + std::to_string(p[0] * kSides.x()) + "\" y=\"" +
                std::to_string(p[1] * kSides.y()) + "\" z=\"" + std::to_string(p[2] * kSides.z()) + "\"/>";
  for (const auto& t : kTriangles)
    triangles += "<triangle v1=\"" + std::to_string(t[0]) + "\" v2=\"" + std::to_string(t[1]) + "\" v3=\"" +
                 std::to_string(t[2]) + "\"/>";
  const std::string head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  return zip(
      {{"[Content_Types].xml",
        head +
            R"(<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>)"},
       {"_rels/.rels",
        head +
            R"(<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)"},
       {"3D/3dmodel.model",
        head + "<model " + unit +
            R"( xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" name="box" type="model"><mesh><vertices>)" +
            vertices + "</vertices><triangles>" + triangles +
            R"(</triangles></mesh></object></resources><build><item objectid="1"/></build></model>)"}});
}

ImportedFile imported(const char* name, const std::string& bytes, ImportJob job = {}) {
  const TemporaryDirectory dir;
  job.file = dir.write(name, bytes);
  return import_file(job);
}

std::string rejection(const char* name, const std::string& bytes, const ImportJob& job = {}) {
  return rejection_message<ImportError>([&] { join_parts(imported(name, bytes, job)); });
}

/// Checks that a body is the box of the tests in millimetres.
void check_box(const ImportedBody& body, double unit_mm) {
  const Vector3d sides = unit_mm * kSides;
  CHECK_FALSE(body.surface);
  CHECK(body.mesh_mm.vertices_m.size() == 8);
  CHECK(body.mesh_mm.triangles.size() == 12);
  const GeometricProperties found = geometric_properties(body.mesh_mm);
  CHECK(found.volume_mm3 == Approx(sides.prod()).epsilon(1e-6));
  CHECK((found.centre_mm - 0.5 * sides).norm() < 1e-6 * sides.norm());
}

void check_contains(const std::string& text, const std::string& part) {
  INFO(text << "\nlacks " << part);
  CHECK(text.find(part) != std::string::npos);
}

ImportJob with_unit(double mm) {
  ImportJob job;
  job.unit_mm = mm;
  return job;
}

}  // namespace

TEST_CASE("glTF is in metres, with the pose of its nodes") {
  check_box(join_parts(imported("a.gltf", inline_gltf())), 1000.0);
  const ImportedFile moved = imported("a.gltf", inline_gltf(R"(,"translation":[0,0,7],"scale":[2,2,-2])"));
  const GeometricProperties found = geometric_properties(join_parts(moved).mesh_mm);
  CHECK(found.volume_mm3 == Approx(8e9 * kSides.prod()));  // positive: a mirrored node still faces outwards
  CHECK(found.centre_mm.z() == Approx(1000.0 * (7.0 - kSides.z())));
}

TEST_CASE("a glTF file takes its buffers only from its own directory") {
  const TemporaryDirectory dir;
  ImportJob job;
  job.file = dir.write("a/model.gltf", gltf("box.bin"));
  check_contains(rejection_message<ImportError>([&] { import_file(job); }), "buffer 'box.bin': no such file");
  dir.write("a/box.bin", gltf_buffer());
  check_box(join_parts(import_file(job)), 1000.0);
  dir.write("box.bin", gltf_buffer());
  dir.write("a/model.gltf", gltf("../box.bin"));
  check_contains(rejection_message<ImportError>([&] { import_file(job); }),
                 "lies outside of the directory of the file; export it as .glb");
}

TEST_CASE("3MF has the unit that it states, by default millimetres") {
  check_box(join_parts(imported("a.3mf", threemf("unit=\"inch\""))), 25.4);
  check_box(join_parts(imported("a.3mf", threemf("unit=\"micron\""))), 1e-3);
  check_box(join_parts(imported("a.3mf", threemf(""))), 1.0);
  check_contains(rejection("a.3mf", threemf("unit=\"parsec\"")), "has the unknown unit 'parsec'");
  check_contains(rejection("a.3mf", "PK nothing"), "is no 3MF archive");
}

TEST_CASE("COLLADA has the unit that it states, otherwise --unit") {
  check_box(join_parts(imported("a.dae", collada(R"(<unit name="centimeter" meter="0.01"/>)"))), 10.0);
  check_box(join_parts(imported("a.dae", collada(""), with_unit(1.0))), 1.0);
  check_contains(rejection("a.dae", collada("")), "states no unit of length; give it with --unit");
  check_contains(rejection("a.dae", collada(R"(<unit meter="0.01"/>)"), with_unit(1.0)), "leave --unit out");
  check_contains(rejection("a.dae", collada(R"(<unit meter="wide"/>)")), "states a unit of 'wide' metres");
}

TEST_CASE("groups of an OBJ file are parts") {
  const std::string two = obj({{"left", 0.0}, {"right", 10.0}});
  const ImportedFile all = imported("a.obj", two, with_unit(1.0));
  REQUIRE(all.parts.size() == 2);
  CHECK(all.parts[0].name == "left");
  CHECK(geometric_properties(join_parts(all).mesh_mm).volume_mm3 == Approx(2.0 * kSides.prod()));
  ImportJob left = with_unit(25.4);
  left.parts = {"left"};
  check_box(join_parts(imported("a.obj", two, left)), 25.4);
  left.parts = {"middle"};
  check_contains(rejection("a.obj", two, left), "has no part 'middle'; --list shows its parts");
  check_contains(rejection("a.obj", two), "states no unit of length; give it with --unit");
}

TEST_CASE("a mesh with a hole is rejected with its place, or accepted as a surface") {
  std::string open = obj({{"box", 0.0}});
  open.erase(open.rfind("f "));
  const std::string message = rejection("a.obj", open, with_unit(1.0));
  check_contains(message, "part 'box'");
  check_contains(message, "accept it as a surface with --surface");
  const ImportedBody body = join_parts(imported("a.obj", open, with_unit(1.0)), {.surface = true});
  CHECK(body.surface);
  CHECK(body.mesh_mm.triangles.size() == 11);
}

TEST_CASE("a damaged mesh file is rejected") {
  check_contains(rejection("a.gltf", "{"), "is not JSON; export it again");
  check_contains(rejection("a.glb", "glTF nothing"), "is damaged or no glTF file");
  check_contains(rejection("a.stl", "", with_unit(1.0)), "is empty");
  check_contains(rejection("a.obj", "v 0 0 0\n", with_unit(1.0)), "export");
  ImportJob few = with_unit(1.0);
  few.max_triangles = 11;
  check_contains(rejection("a.obj", obj({{"box", 0.0}}), few), "has more than 11 triangles");
}

}  // namespace wrenchd::test_mesh_import
