// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_loader.hpp"

#include <algorithm>
#include <iomanip>
#include <locale>
#include <sstream>
#include <system_error>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_repair.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/mesh_union.hpp"
#include "collision/meshes/packer.hpp"
#include "collision/meshes/self_intersection.hpp"

namespace wrenchd {
namespace {

template <class T>
std::string_view bytes_of(const std::vector<T>& list) {
  return {reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T)};
}

/// Returns an upper bound in micrometres: "at most 0.98 um", or "less than 1 nm".
std::string bound_text(double length_m) {
  if (length_m < 1e-9) return "less than 1 nm";
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << "at most " << std::setprecision(2) << 1e6 * length_m << " um";
  return text.str();
}

/// Adds a text once, although thousands of bodies may share a file.
void add_once(std::vector<std::string>& list, const std::string& text) {
  if (std::find(list.begin(), list.end(), text) == list.end()) list.push_back(text);
}

std::string_view body_kind_name(BodyKind kind) {
  return kind == BodyKind::solid ? "solid" : "surface";
}

/// Smooths a simplified mesh, or the loaded mesh if it was not simplified. source_vertex and source_triangle
/// of the result refer to the loaded mesh.
SimplifiedMesh smoothed(SimplifiedMesh simplified, const TriangleMesh& loaded, const Smoothing& smoothing) {
  if (simplified.mesh.triangles.empty()) return smoothed(loaded, smoothing);
  SimplifiedMesh out = smoothed(simplified.mesh, smoothing);
  for (std::uint32_t& vertex : out.source_vertex) vertex = simplified.source_vertex[vertex];
  for (std::uint32_t& triangle : out.source_triangle) triangle = simplified.source_triangle[triangle];
  out.distance_m += simplified.distance_m;
  return out;
}

template <class Use>
void visit_parts(LoadedMesh& loaded, const Use& use) {
  use(loaded.mesh.vertices_m), use(loaded.mesh.triangles), use(loaded.repairs), use(loaded.parts_overlap);
}
template <class Use>
void visit_parts(ConvexBody& hull, const Use& use) {
  use(hull.vertices_T_m), use(hull.ring_begin), use(hull.ring);
}
template <class Use>
void visit_parts(MeshBvh& mesh_bvh, const Use& use) {
  mesh_bvh.visit_members(use);
}

}  // namespace

std::string rejection_text(const std::filesystem::path& file, const PolygonSoup& soup, BodyKind kind,
                           const MeshReport& report) {
  std::string text =
      file.string() + (kind == BodyKind::solid ? ": is not a closed, consistently oriented solid:"
                                               : ": cannot be used, not even as a surface:");
  for (const std::string& defect : report.defects) text += "\n  " + defect;
  for (const std::string& change : report.repairs) text += "\n  (after a repair: " + change + ")";
  if (kind == BodyKind::solid && check_surface(soup).defects.empty())
    text +=
        "\n  it may be used as it is with kind = \"surface\": it then has two sides and no inside; the "
        "inertia of "
        "such a tool is that of its convex hull, or as [tool] inertia states";
  return text;
}

std::string contact_surface_text(std::size_t used, std::size_t triangles, double distance_m) {
  return with_thousands_separators(used) + " of " + with_thousands_separators(triangles) + " triangles, " +
         bound_text(distance_m) + " outside the mesh";
}

std::string with_thousands_separators(std::size_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, 1, ',');
  return text;
}

void MeshLoader::report_progress(const std::filesystem::path& file, std::size_t triangles,
                                 const std::string& what) const {
  if (progress_ && triangles >= kLargeMeshTriangles)
    progress_(file.filename().string() + ": " + with_thousands_separators(triangles) + " triangles, " + what);
}

/// Returns the cached result for `made_from`, or computes and caches it.
template <class T, class Make>
T MeshLoader::cached(const std::vector<std::string_view>& made_from, bool large, const Make& make) {
  if (cache_.disabled() || !large) return make();
  const std::string key = MeshCache::key(made_from);
  if (const auto bytes = cache_.read(key)) {
    T value;
    const Unpacker unpack(*bytes);
    visit_parts(value, unpack);
    if (unpack.at_end()) return value;
  }
  T value = make();
  std::string bytes;
  visit_parts(value, Packer(bytes));
  if (!cache_.write(key, bytes)) {
    add_once(warnings_, cache_.error());
    cache_ = MeshCache({});
  }
  return value;
}

void MeshLoader::add(const std::filesystem::path& name, PolygonSoup soup) {
  added_[name] = std::make_shared<const PolygonSoup>(std::move(soup));
}

std::shared_ptr<const LoadedMesh> MeshLoader::load(const std::filesystem::path& file, BodyKind kind,
                                                   const std::optional<GeneratedMesh>& made) {
  if (const auto added = added_.find(file); added != added_.end()) {
    const Key key{file, kind};
    auto& loaded = loaded_[key];
    if (!loaded) loaded = std::make_shared<const LoadedMesh>(check_added(*added->second, file, kind));
    return use(key, loaded, {});
  }
  const Key key = key_of(file, kind, !made);
  auto& loaded = loaded_[key];
  if (!loaded) loaded = std::make_shared<const LoadedMesh>(made ? make(*made, file, kind) : read(file, kind));
  return use(key, loaded, {file});
}

/// The name counts, not what it leads to now: a mesh that was loaded stays in use when its name becomes a
/// link.
MeshLoader::Key MeshLoader::key_of(const std::filesystem::path& file, BodyKind kind, bool is_file) const {
  if (!is_file) return {file, kind};
  return {std::filesystem::absolute(file).lexically_normal(), kind};
}

/// Notes that the scene uses a mesh. files: the names of its files in the scene.
std::shared_ptr<const LoadedMesh> MeshLoader::use(const Key& key,
                                                  const std::shared_ptr<const LoadedMesh>& loaded,
                                                  const std::vector<std::filesystem::path>& files) {
  used_.insert(key);
  for (std::size_t i = 0; i < std::min(files.size(), loaded->inputs.size()); ++i)
    inputs_[files[i]] = loaded->inputs[i];
  return with_changes(loaded, key.second);
}

void MeshLoader::begin_scene() {
  changes_.clear();
  simplifications_.clear();
  warnings_.clear();
  used_.clear();
  inputs_.clear();
}

void MeshLoader::drop_unused() {
  std::erase_if(loaded_, [this](const auto& entry) { return !used_.contains(entry.first); });
}

const MeshInput* MeshLoader::input(const std::filesystem::path& file) const {
  const auto found = inputs_.find(file);
  return found == inputs_.end() ? nullptr : &found->second;
}

/// Returns the bytes of a file, or its SHA-256 alone if too many bytes are kept already.
MeshInput MeshLoader::keep(const MeshSource& source) {
  MeshInput input{std::filesystem::absolute(source.file).lexically_normal(), sha256_text(source.bytes), {}};
  std::size_t kept = 0;
  for (const auto& bytes : kept_)
    if (const auto alive = bytes.lock()) kept += alive->size();
  if (kept + source.bytes.size() > kMaxKeptBytes) return input;
  input.bytes = std::make_shared<const std::string>(source.bytes);
  kept_.push_back(input.bytes);
  return input;
}

/// Adds the changes of a mesh to those of the loader.
std::shared_ptr<const LoadedMesh> MeshLoader::with_changes(const std::shared_ptr<const LoadedMesh>& loaded,
                                                           BodyKind kind) {
  const std::string begin = loaded->file.string() + ": ";
  for (const std::string& change : loaded->repairs) add_change(begin + change);
  if (kind == BodyKind::surface)
    add_change(
        begin +
        "used as a surface: it has two sides and no inside, so that nothing pushes out a body that starts "
        "beyond it");
  return loaded;
}

void MeshLoader::add_change(const std::string& change) {
  add_once(changes_, change);
}

LoadedMesh MeshLoader::repair_and_check(PolygonSoup soup, const std::filesystem::path& file,
                                        BodyKind kind) const {
  LoadedMesh made;
  report_progress(file, soup.faces.size(), "checking");
  const MeshReport report = kind == BodyKind::solid ? repair_and_check_solid(soup, &made.mesh)
                                                    : repair_and_check_surface(soup, &made.mesh);
  if (!report.defects.empty()) throw MeshError(rejection_text(file, soup, kind, report));
  made.repairs = report.repairs;
  if (!report.tolerated.empty()) made.repairs.push_back(report.tolerated);
  return made;
}

std::shared_ptr<const LoadedMesh> MeshLoader::load_parts(const std::vector<std::filesystem::path>& files,
                                                         BodyKind kind) {
  std::string names;
  for (const std::filesystem::path& file : files)
    names += "part " + key_of(file, kind, true).first.string() + '\n';  // no file name begins so
  const Key key{names, kind};
  auto& loaded = loaded_[key];
  if (loaded) return use(key, loaded, files);
  std::vector<MeshSource> sources;
  std::vector<MeshInput> inputs;
  std::vector<std::string> extensions;
  std::size_t bytes = 0;
  for (const std::filesystem::path& file : files) {
    sources.push_back(read_mesh_source(file, scope_));
    inputs.push_back(keep(sources.back()));
    extensions.push_back(file.extension().string());
    bytes += sources.back().bytes.size();
  }
  std::vector<std::string_view> made_from = {"parts", body_kind_name(kind)};
  for (std::size_t i = 0; i < files.size(); ++i) {
    made_from.push_back(extensions[i]);
    made_from.push_back(sources[i].bytes);
  }
  const bool large = bytes >= kLargeMeshBytes;
  if (progress_ && large)
    progress_(files.front().filename().string() + " and " + std::to_string(files.size() - 1) +
              " more: uniting the parts");
  LoadedMesh made = cached<LoadedMesh>(made_from, large, [&] { return join_parts(sources, kind); });
  made.file = files.front();
  made.inputs = std::move(inputs);
  loaded = std::make_shared<const LoadedMesh>(std::move(made));
  return use(key, loaded, files);
}

LoadedMesh MeshLoader::join_parts(std::vector<MeshSource> sources, BodyKind kind) const {
  std::vector<TriangleMesh> parts;
  LoadedMesh made;
  for (MeshSource& source : sources) {
    const std::filesystem::path file = source.file;
    PolygonSoup soup = parse_mesh(std::move(source));
    report_progress(file, soup.faces.size(), "checking");
    TriangleMesh whole;
    const MeshReport report = kind == BodyKind::solid ? repair_and_check_solid(soup, &whole)
                                                      : repair_and_check_surface(soup, &whole);
    const std::string begin = file.filename().string() + ": ";
    for (const std::string& change : report.repairs) made.repairs.push_back(begin + change);
    if (report.defects.empty()) {
      if (!report.tolerated.empty()) made.repairs.push_back(begin + report.tolerated);
      parts.push_back(std::move(whole));
      continue;
    }
    std::vector<TriangleMesh> shells =
        kind == BodyKind::solid ? solid_shells(soup) : std::vector<TriangleMesh>{};
    if (shells.empty()) throw MeshError(rejection_text(file, soup, kind, report));
    made.repairs.push_back(begin + "its " + std::to_string(shells.size()) + " shells are parts of one body");
    for (TriangleMesh& shell : shells) parts.push_back(std::move(shell));
  }
  if (kind == BodyKind::surface) {
    made.mesh = together(parts);
    return made;
  }
  UnitedMesh all = unite(parts);
  made.mesh = std::move(all.mesh);
  made.parts_overlap = !all.united;
  made.repairs.push_back(std::to_string(parts.size()) + " parts are one body" +
                         (all.united
                              ? ": their union"
                              : "; their surfaces could not be united, so the volume in which they overlap "
                                "counts twice in the inertia"));
  return made;
}

LoadedMesh MeshLoader::read(const std::filesystem::path& file, BodyKind kind) {
  const MeshSource source = read_mesh_source(file, scope_);
  MeshInput input = keep(source);
  const std::size_t size = source.bytes.size();
  const bool large = size >= kLargeMeshBytes;
  if (progress_ && large)
    progress_(file.filename().string() + ": reading " + with_thousands_separators(size / 1'000'000) + " MB");
  const std::string extension = file.extension().string();
  LoadedMesh loaded = cached<LoadedMesh>({"mesh", extension, body_kind_name(kind), source.bytes}, large,
                                         [&] { return repair_and_check(parse_mesh(source), file, kind); });
  loaded.file = file;
  loaded.inputs.push_back(std::move(input));
  return loaded;
}

/// A generated mesh is checked as a file is, because some dimensions may yield walls that are too thin.
LoadedMesh MeshLoader::make(const GeneratedMesh& made, const std::filesystem::path& name, BodyKind kind) {
  const TriangleMesh mesh = make_mesh(made);
  const bool large = mesh.triangles.size() >= kLargeMeshTriangles;
  const std::vector<std::string_view> made_from = {"made", body_kind_name(kind), bytes_of(mesh.vertices_m),
                                                   bytes_of(mesh.triangles)};
  LoadedMesh loaded = cached<LoadedMesh>(made_from, large, [&] {
    PolygonSoup soup{mesh.vertices_m, {}};
    for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
    return repair_and_check(std::move(soup), name, kind);
  });
  loaded.file = name;
  return loaded;
}

LoadedMesh MeshLoader::check_added(const PolygonSoup& soup, const std::filesystem::path& name,
                                   BodyKind kind) {
  LoadedMesh loaded = repair_and_check(soup, name, kind);
  loaded.file = name;
  return loaded;
}

ConvexBody MeshLoader::hull(const LoadedMesh& loaded) {
  const std::size_t triangles = loaded.mesh.triangles.size();
  return cached<ConvexBody>({"hull", bytes_of(loaded.mesh.vertices_m), bytes_of(loaded.mesh.triangles)},
                            triangles >= kLargeMeshTriangles, [&] {
                              report_progress(loaded.file, triangles, "finding its convex hull");
                              return convex_hull(loaded.mesh);
                            });
}

std::shared_ptr<const MeshBvh> MeshLoader::build_bvh(TriangleMesh mesh, BodyKind kind,
                                                     const std::filesystem::path& file,
                                                     double surface_tolerance_m, const Smoothing& smoothing) {
  const std::size_t triangles = mesh.triangles.size();
  const double tolerance_m =
      kind == BodyKind::solid ? simplification_tolerance_m(mesh, surface_tolerance_m) : 0.0;
  const auto bytes = [](const auto& x) {
    return std::string_view(reinterpret_cast<const char*>(&x), sizeof x);
  };
  std::vector<std::string_view> made_from = {"bvh", body_kind_name(kind), bytes(tolerance_m),
                                             bytes_of(mesh.vertices_m), bytes_of(mesh.triangles)};
  const bool smooth = smoothing.most_m > 0.0;
  if (smooth) made_from.insert(made_from.end(), {bytes(smoothing.most_m), bytes(smoothing.max_triangles)});
  const bool large = triangles >= kLargeMeshTriangles || smooth;
  auto bvh = std::make_shared<const MeshBvh>(cached<MeshBvh>(made_from, large, [&] {
    SimplifiedMesh surface;
    if (tolerance_m > 0.0) {
      report_progress(file, triangles, "finding its contact surface");
      surface = simplify_enclosing(mesh, tolerance_m);
    }
    if (smooth) surface = smoothed(std::move(surface), mesh, smoothing);
    report_progress(file, std::max(triangles, surface.mesh.triangles.size()),
                    "finding its edges and building its BVH");
    const bool changed = surface.distance_m > 0.0 || surface.mesh.triangles.size() < triangles;
    MeshBvh made = surface.mesh.triangles.empty() || !changed ? MeshBvh(mesh, kind)
                                                              : MeshBvh(std::move(surface), mesh, kind);
    made.divides_space = made.surface.is_closed() && !intersects_itself(made.surface.mesh());
    return made;
  }));
  const std::size_t used = bvh->surface.triangles().size();
  const bool is_other = used != triangles || bvh->surface_tolerance_m > 0.0;
  if (smooth && is_other)
    add_once(simplifications_, file.string() + ": contacts use a smoothed surface of " +
                                   with_thousands_separators(used) + " triangles in place of " +
                                   with_thousands_separators(triangles) + ", " +
                                   bound_text(bvh->surface_tolerance_m) + " away from them");
  else if (is_other)
    add_once(simplifications_, file.string() + ": contacts use an enclosing surface of " +
                                   contact_surface_text(used, triangles, bvh->surface_tolerance_m));
  return bvh;
}

void MeshLoader::check_size(const LoadedMesh& loaded, double scale, PlausibleSize likely) {
  if (const auto unlikely = implausible_size(loaded.mesh, scale, likely))
    add_once(warnings_, loaded.file.string() + ": " + *unlikely);
}

}  // namespace wrenchd
