// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_cache.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/scene.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_mesh_loader {

namespace {

namespace fs = std::filesystem;
using namespace test;

const PolygonSoup kBox = box({0, 0, 0}, {0.2, 0.3, 0.5});

std::string refusal_of(MeshLoader& loader, const fs::path& file, BodyKind kind) {
  try {
    loader.load(file, kind);
  } catch (const MeshError& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("a loader reports each change once, with the file", "[mesh_loader]") {
  const TemporaryDirectory dir;
  PolygonSoup soup = inside_out(kBox);
  soup.faces.push_back(soup.faces[0]);
  const fs::path file = dir.write("box.ply", as_ascii_ply(soup));
  MeshLoader loader;
  const auto loaded = loader.load(file, BodyKind::solid);
  CHECK(loader.load(file, BodyKind::solid) == loaded);
  CHECK(loader.load(dir.path() / "." / "box.ply", BodyKind::solid) == loaded);
  CHECK(loader.changes() ==
        std::vector<std::string>{file.string() + ": removed 1 duplicate face: face 6 near (0, 0.3, 0)",
                                 file.string() + ": flipped 6 faces, first face 0 near (0, 0.3, 0)"});
  CHECK(loader.warnings().empty());
  loader.check_size(*loaded, 1000.0, kPlausibleToolSize);
  loader.check_size(*loaded, 1000.0, kPlausibleToolSize);
  REQUIRE(loader.warnings().size() == 1);
  CHECK(loader.warnings()[0].find(file.string() + ": its largest side is 500 m") == 0);
}

TEST_CASE("an open mesh is rejected with the key that makes it a surface, and is accepted with that key",
          "[mesh_loader]") {
  const TemporaryDirectory dir;
  PolygonSoup open = kBox;
  open.faces.pop_back();
  std::reverse(open.faces[0].begin(), open.faces[0].end());
  const fs::path file = dir.write("open.obj", as_obj(open));
  MeshLoader loader;
  const std::string messages = refusal_of(loader, file, BodyKind::solid);
  CHECK(messages.find(file.string() + ": is not a closed, consistently oriented solid:\n  the edge from (") ==
        0);
  CHECK(messages.find("\n  (after a repair: flipped 1 face: face 0 near ") != std::string::npos);
  CHECK(messages.find("kind = \"surface\"") != std::string::npos);
  CHECK(loader.load(file, BodyKind::surface)->mesh.triangles.size() == 10);
  REQUIRE(loader.changes().size() == 2);
  CHECK(loader.changes()[1].find("used as a surface: it has two sides and no inside") != std::string::npos);

  const fs::path none = dir.write("none.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3 4\n");
  const std::string hopeless = refusal_of(loader, none, BodyKind::solid);
  CHECK(hopeless.find("kind = \"surface\"") == std::string::npos);
  CHECK(refusal_of(loader, none, BodyKind::surface)
            .find(none.string() +
                  ": cannot be used, not even as a surface:\n  there is no face that has an area") == 0);
}

std::string off_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return as_off(soup);
}

template <class T>
std::string bytes_of(const std::vector<T>& list) {
  return {reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T)};
}

void check_same(const MeshBvh& a, const MeshBvh& b) {
  CHECK(a.surface.mesh().triangles == b.surface.mesh().triangles);
  CHECK(a.surface.vertices_m() == b.surface.vertices_m());
  CHECK(bytes_of(a.surface.planes()) == bytes_of(b.surface.planes()));
  CHECK(bytes_of(a.surface.features()) == bytes_of(b.surface.features()));
  CHECK(bytes_of(a.surface.convex_edges()) == bytes_of(b.surface.convex_edges()));
  CHECK(a.surface.radius_m() == b.surface.radius_m());
  CHECK(a.surface.is_closed() == b.surface.is_closed());
  CHECK(a.divides_space == b.divides_space);
  for (std::uint32_t v = 0; v < a.surface.vertices_m().size(); v += 97) {
    const auto x = a.surface.ring_of(v), y = b.surface.ring_of(v);
    CHECK(std::equal(x.begin(), x.end(), y.begin(), y.end()));
  }
  CHECK(bytes_of(a.bvh.boxes()) == bytes_of(b.bvh.boxes()));
  CHECK(a.bvh.nodes().size() == b.bvh.nodes().size());
  CHECK(a.bvh.leaves().size() == b.bvh.leaves().size());
  CHECK(a.bvh.extent_m() == b.bvh.extent_m());
}

std::vector<std::string> files_of(const fs::path& directory) {
  std::vector<std::string> files;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(directory, none)) files.push_back(entry.path().string());
  return files;
}

TEST_CASE("a large mesh is reported and cached, and the cached result is equal", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const fs::path cache = dir.path() / "cache";
  const TriangleMesh made = make_mesh({"bumpy", 60000});
  const fs::path file = dir.write("bumpy.off", off_of(made));
  std::vector<std::string> messages;
  const auto load = [&] {
    messages.clear();
    MeshLoader loader(cache, [&](const std::string& what) { messages.push_back(what); });
    const auto loaded = loader.load(file, BodyKind::solid);
    const ConvexBody hull = loader.hull(*loaded);
    CHECK(loader.warnings().empty());
    CHECK(loader.changes().empty());
    return std::tuple(loaded, hull, loader.build_bvh(loaded->mesh, BodyKind::solid, file, 0.0));
  };
  const auto [cold, cold_hull, cold_tree] = load();
  const std::string size = with_thousands_separators(made.triangles.size());
  REQUIRE(messages.size() == 4);
  CHECK(messages[0] == "bumpy.off: reading 3 MB");
  CHECK(messages[1] == "bumpy.off: " + size + " triangles, checking");
  CHECK(messages[2] == "bumpy.off: " + size + " triangles, finding its convex hull");
  CHECK(messages[3] == "bumpy.off: " + size + " triangles, finding its edges and building its BVH");
  REQUIRE(files_of(cache).size() == 3);

  const auto [warm, warm_hull, warm_tree] = load();
  CHECK(messages == std::vector<std::string>{"bumpy.off: reading 3 MB"});
  CHECK(warm->mesh.vertices_m == made.vertices_m);
  CHECK(warm->mesh.triangles == made.triangles);
  CHECK(warm_hull.vertices_T_m == cold_hull.vertices_T_m);
  CHECK(warm_hull.ring == cold_hull.ring);
  check_same(*warm_tree, *cold_tree);
  check_same(*warm_tree, MeshBvh(made));

  SECTION("another file is another key") {
    dir.write("bumpy.off", off_of(make_mesh({"bumpy", 60000, 2})));
    load();
    CHECK(messages.size() == 4);
    CHECK(files_of(cache).size() == 6);
  }
  SECTION("spoilt files are made again") {
    for (const std::string& kept : files_of(cache)) fs::resize_file(kept, fs::file_size(kept) / 2);
    const auto [again, again_hull, again_tree] = load();
    CHECK(messages.size() == 4);
    check_same(*again_tree, *cold_tree);
    load();
    CHECK(messages.size() == 1);
  }
}

TEST_CASE("a generated mesh is checked and cached like a file", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const fs::path cache = dir.path() / "cache";
  const GeneratedMesh bumpy = {"bumpy", 60000};
  const std::string name = generated_mesh_name(bumpy),
                    size = with_thousands_separators(make_mesh(bumpy).triangles.size());
  std::vector<std::string> messages;
  const auto load = [&] {
    messages.clear();
    MeshLoader loader(cache, [&](const std::string& what) { messages.push_back(what); });
    const auto loaded = loader.load(name, BodyKind::solid, bumpy);
    CHECK(loader.load(name, BodyKind::solid, bumpy) == loaded);
    CHECK(loader.changes().empty());
    CHECK(loaded->file == name);
    return loaded->mesh;
  };
  CHECK(load().vertices_m == make_mesh(bumpy).vertices_m);
  CHECK(messages == std::vector<std::string>{name + ": " + size + " triangles, checking"});
  CHECK(files_of(cache).size() == 1);
  CHECK(load().triangles == make_mesh(bumpy).triangles);
  CHECK(messages.empty());
}

TEST_CASE("a cache that cannot be written causes a warning", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("bumpy.off", off_of(make_mesh({"bumpy", 60000})));
  MeshLoader loader(dir.write("no_directory", "") / "cache", {});
  loader.hull(*loader.load(file, BodyKind::solid));
  REQUIRE(loader.warnings().size() == 1);
  CHECK(loader.warnings()[0].find("cannot be made") != std::string::npos);
  CHECK(loader.warnings()[0].find("; results for large meshes are not cached") != std::string::npos);
}

TEST_CASE("contacts use a simplified solid, and the loader says so", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const TriangleMesh cube = make_mesh({"cube", 60000});
  const fs::path file = dir.write("cube.off", off_of(cube));
  const auto load = [&](BodyKind kind, double tolerance_m) {
    MeshLoader loader(dir.path() / "cache", {});
    const auto bvh = loader.build_bvh(loader.load(file, kind)->mesh, kind, file, tolerance_m);
    return std::pair(bvh, loader.simplifications());
  };
  for (int cold_and_warm = 0; cold_and_warm < 2; ++cold_and_warm) {
    const auto [bvh, said] = load(BodyKind::solid, 1e-6);
    CHECK(bvh->surface.triangles().size() == 12);
    CHECK(bvh->loaded_mesh().triangles.size() == cube.triangles.size());
    CHECK(bvh->surface_tolerance_m < 1e-9);
    for (std::uint32_t v = 0; v < 8; ++v)
      CHECK((bvh->loaded_mesh().vertices_m[bvh->loaded_vertex(v)] - bvh->surface.vertices_m()[v]).norm() <
            1e-9);
    REQUIRE(said.size() == 1);
    CHECK(said[0] == file.string() + ": contacts use an enclosing surface of 12 of " +
                         with_thousands_separators(cube.triangles.size()) +
                         " triangles, less than 1 nm outside the mesh");
  }
  for (const auto& [kind, tolerance_m] : {std::pair(BodyKind::solid, 0.0), {BodyKind::surface, 1e-6}}) {
    const auto [bvh, said] = load(kind, tolerance_m);
    CHECK(bvh->surface.triangles().size() == cube.triangles.size());
    CHECK(bvh->loaded_mesh().triangles.size() == cube.triangles.size());
    CHECK(bvh->loaded_triangle(7) == 7);
    CHECK(said.empty());
  }
}

TEST_CASE("a surface divides space if it is closed and does not intersect itself", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const auto divides_space = [&](const TriangleMesh& mesh, BodyKind kind) {
    MeshLoader loader;
    const fs::path file = dir.write("mesh.off", off_of(mesh));
    return loader.build_bvh(mesh, kind, file, 1e-6)->divides_space;
  };
  const TriangleMesh ball = make_mesh({"sphere", 300});
  CHECK(divides_space(ball, BodyKind::surface));
  CHECK_FALSE(divides_space(ball, BodyKind::solid));  // a solid has one side anyway
  TriangleMesh open = ball;
  open.triangles.pop_back();
  CHECK_FALSE(divides_space(open, BodyKind::surface));
  TriangleMesh pierced = ball;
  pierced.vertices_m[0] *= -1.5;  // through the opposite side
  CHECK(MeshSurface(pierced, BodyKind::surface).is_closed());
  CHECK_FALSE(divides_space(pierced, BodyKind::surface));
}

TEST_CASE("a small mesh is neither reported nor cached", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("box.off", as_off(kBox)), cache = dir.path() / "cache";
  MeshLoader loader(cache, [](const std::string& what) { FAIL(what); });
  const auto loaded = loader.load(file, BodyKind::solid);
  loader.build_bvh(loaded->mesh, BodyKind::solid, file, 1e-6);
  CHECK_FALSE(fs::exists(cache));
}

template <class T>
std::size_t size_of_members(T thing) {
  std::size_t sum = 0;
  thing.visit_members([&](const auto& member) { sum += (sizeof member + 7) / 8 * 8; });
  return sum;
}

TEST_CASE("the cache stores every data member", "[mesh_loader]") {
  CHECK(size_of_members(MeshSurface()) == sizeof(MeshSurface));
  CHECK(size_of_members(TriangleBvh()) == sizeof(TriangleBvh));
}

TEST_CASE("a loader keeps the bytes that it has read, and their hash beyond 32 MiB", "[mesh_loader]") {
  const TemporaryDirectory dir;
  const std::string bytes = as_off(kBox);
  const fs::path file = dir.write("box.off", bytes);
  MeshLoader loader;
  loader.load(file, BodyKind::solid);
  dir.write("box.off", "changed afterwards");
  const MeshInput* input = loader.input(file);
  REQUIRE(input != nullptr);
  REQUIRE(input->bytes);
  CHECK(*input->bytes == bytes);
  CHECK(input->sha256 == sha256_text(bytes));
  CHECK(sha256_text("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(loader.input(dir.path() / "other.off") == nullptr);

  // The next scene uses the mesh that is loaded, and not the file as it is now.
  MeshLoader next = loader;
  next.begin_scene();
  CHECK(next.input(file) == nullptr);
  CHECK_NOTHROW(next.load(file, BodyKind::solid));
  next.drop_unused();
  CHECK(*next.input(file)->bytes == bytes);
  next.begin_scene();
  next.drop_unused();
  CHECK_THROWS_AS(next.load(file, BodyKind::solid), MeshError);

  MeshLoader large;
  const fs::path first = dir.write("first.off", bytes + std::string(20 << 20, '\n'));
  const fs::path second = dir.write("second.off", bytes + std::string(20 << 20, '\n'));
  large.load(first, BodyKind::solid);
  large.load(second, BodyKind::solid);
  CHECK(large.input(first)->bytes);
  CHECK_FALSE(large.input(second)->bytes);
  CHECK(large.input(second)->sha256 == large.input(first)->sha256);
}

TEST_CASE("numbers have thousands separators", "[mesh_loader]") {
  CHECK(with_thousands_separators(0) == "0");
  CHECK(with_thousands_separators(999) == "999");
  CHECK(with_thousands_separators(1000) == "1,000");
  CHECK(with_thousands_separators(1003520) == "1,003,520");
  CHECK(with_thousands_separators(12345678901) == "12,345,678,901");
}

}  // namespace
}  // namespace wrenchd::test_mesh_loader
