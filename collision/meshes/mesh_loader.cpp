// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_loader.hpp"

#include <algorithm>
#include <locale>
#include <sstream>
#include <system_error>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_repair.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/packer.hpp"

namespace wrenchd {
namespace {

template <class T>
std::string_view bytes_of(const std::vector<T>& list) {
  return {reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T)};
}

/// Of thousands of bodies of one file the first has said it.
void add_once(std::vector<std::string>& list, const std::string& text) {
  if (std::find(list.begin(), list.end(), text) == list.end()) list.push_back(text);
}

std::string_view name_of(BodyKind kind) {
  return kind == BodyKind::solid ? "solid" : "surface";
}

template <class Use>
void each_part(LoadedMesh& loaded, const Use& use) {
  use(loaded.mesh.vertices_m), use(loaded.mesh.triangles), use(loaded.changes);
}
template <class Use>
void each_part(ConvexBody& hull, const Use& use) {
  use(hull.vertices_T_m), use(hull.ring_begin), use(hull.ring);
}
template <class Use>
void each_part(TreedMesh& treed, const Use& use) {
  treed.surface.each_member(use), treed.tree.each_member(use);
}

}  // namespace

std::string refusal(const std::filesystem::path& file, const PolygonSoup& soup, BodyKind kind,
                    const MeshReport& report) {
  std::string text =
      file.string() + (kind == BodyKind::solid ? ": is not a closed, consistently oriented solid:"
                                               : ": cannot be used, not even as a surface:");
  for (const std::string& defect : report.defects) text += "\n  " + defect;
  for (const std::string& change : report.changes) text += "\n  (after a repair: " + change + ")";
  if (kind == BodyKind::solid && check_surface(soup).defects.empty())
    text +=
        "\n  an obstacle may be used as it is with kind = \"surface\": it then has two sides and no inside; "
        "a "
        "tool has to be a solid";
  return text;
}

std::string grouped(std::size_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, ",");
  return text;
}

void MeshLoader::tell(const std::filesystem::path& file, std::size_t triangles,
                      const std::string& what) const {
  if (progress_ && triangles >= kManyTriangles)
    progress_(file.filename().string() + ": " + grouped(triangles) + " triangles, " + what);
}

/// From the cache, or made and put there. key: all that it is made from.
template <class T, class Make>
T MeshLoader::kept(const std::vector<std::string_view>& made_from, bool large, const Make& make) {
  if (cache_.off() || !large) return make();
  const std::string key = MeshCache::key(made_from);
  if (const auto bytes = cache_.read(key)) {
    T value;
    const Unpacker unpack(*bytes);
    each_part(value, unpack);
    if (unpack.at_end()) return value;
  }
  T value = make();
  std::string bytes;
  each_part(value, Packer(bytes));
  if (!cache_.write(key, bytes)) {
    add_once(remarks_, cache_.why());
    cache_ = MeshCache({});
  }
  return value;
}

std::shared_ptr<const LoadedMesh> MeshLoader::load(const std::filesystem::path& file, BodyKind kind,
                                                   const std::optional<MadeMesh>& made) {
  std::error_code error;
  const std::filesystem::path same = std::filesystem::weakly_canonical(file, error);
  auto& loaded = loaded_[{error || made ? file : same, kind}];
  if (!loaded) loaded = std::make_shared<const LoadedMesh>(made ? make(*made, file, kind) : read(file, kind));
  const std::string begin = loaded->file.string() + ": ";
  for (const std::string& change : loaded->changes) add_once(changes_, begin + change);
  if (kind == BodyKind::surface)
    add_once(changes_, begin +
                           "taken as a surface: it has two sides and no inside, so that nothing pushes out a "
                           "tool that starts "
                           "beyond it");
  return loaded;
}

LoadedMesh MeshLoader::checked(PolygonSoup soup, const std::filesystem::path& file, BodyKind kind) const {
  LoadedMesh made;
  tell(file, soup.faces.size(), "checking");
  const MeshReport report = kind == BodyKind::solid ? repair_and_check_solid(soup, &made.mesh)
                                                    : repair_and_check_surface(soup, &made.mesh);
  if (!report.defects.empty()) throw MeshError(refusal(file, soup, kind, report));
  made.changes = report.changes;
  return made;
}

LoadedMesh MeshLoader::read(const std::filesystem::path& file, BodyKind kind) {
  MeshSource source = read_mesh_source(file);
  const std::size_t size = source.bytes.size();
  const bool large = size >= kManyBytes;
  if (progress_ && large)
    progress_(file.filename().string() + ": reading " + grouped(size / 1'000'000) + " MB");
  const std::string extension = file.extension().string();
  LoadedMesh loaded = kept<LoadedMesh>({"mesh", extension, name_of(kind), source.bytes}, large,
                                       [&] { return checked(parse_mesh(source), file, kind); });
  loaded.file = file;
  return loaded;
}

/// What was made is looked at like a file: a body of somebody's measures may come out thinner than it can be.
LoadedMesh MeshLoader::make(const MadeMesh& made, const std::filesystem::path& name, BodyKind kind) {
  const TriangleMesh mesh = make_mesh(made);
  const bool large = mesh.triangles.size() >= kManyTriangles;
  const std::vector<std::string_view> made_from = {"made", name_of(kind), bytes_of(mesh.vertices_m),
                                                   bytes_of(mesh.triangles)};
  LoadedMesh loaded = kept<LoadedMesh>(made_from, large, [&] {
    PolygonSoup soup{mesh.vertices_m, {}};
    for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
    return checked(std::move(soup), name, kind);
  });
  loaded.file = name;
  return loaded;
}

ConvexBody MeshLoader::hull(const LoadedMesh& loaded) {
  const std::size_t triangles = loaded.mesh.triangles.size();
  return kept<ConvexBody>({"hull", bytes_of(loaded.mesh.vertices_m)}, triangles >= kManyTriangles, [&] {
    tell(loaded.file, triangles, "finding its convex hull");
    return convex_hull(loaded.mesh.vertices_m);
  });
}

std::shared_ptr<const TreedMesh> MeshLoader::treed(TriangleMesh mesh, BodyKind kind,
                                                   const std::filesystem::path& file) {
  const std::size_t triangles = mesh.triangles.size();
  const std::vector<std::string_view> made_from = {"treed", name_of(kind), bytes_of(mesh.vertices_m),
                                                   bytes_of(mesh.triangles)};
  return std::make_shared<const TreedMesh>(kept<TreedMesh>(made_from, triangles >= kManyTriangles, [&] {
    tell(file, triangles, "finding its edges and building its tree");
    return TreedMesh(mesh, kind);
  }));
}

void MeshLoader::look_at_size(const LoadedMesh& loaded, double scale, LikelySize likely) {
  if (const auto unlikely = unlikely_size(loaded.mesh, scale, likely))
    add_once(remarks_, loaded.file.string() + ": " + *unlikely);
}

}  // namespace wrenchd
