// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_bvh.hpp"
#include "collision/meshes/mesh_cache.hpp"
#include "collision/meshes/mesh_size.hpp"
#include "collision/meshes/mesh_smoother.hpp"
#include "core/convex_body.hpp"
#include "core/files/opened_file.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

struct MeshReport;
struct MeshSource;
struct PolygonSoup;

/// A mesh file as the loader has read it.
struct MeshInput {
  std::filesystem::path file;                ///< absolute name
  std::string sha256;                        ///< SHA-256 of the file, in hexadecimal
  std::shared_ptr<const std::string> bytes;  ///< null beyond MeshLoader::kMaxKeptBytes
};

/// A mesh that was read from a file, repaired and checked, or a mesh that was generated and checked.
struct LoadedMesh {
  std::filesystem::path file;
  TriangleMesh mesh;  ///< in the units of the file
  /// one sentence for each kind of repair (mesh_repair.hpp), and for overlaps that are tolerated
  std::vector<std::string> repairs;
  /// True if parts of a solid overlap, so that the volume in which they do counts twice.
  bool parts_overlap = false;
  std::vector<MeshInput> inputs = {};  ///< one for each file; empty for a generated mesh
};

/// Loads meshes and prepares them for contact queries. It reads each file once, for any number of bodies.
///
/// The loader keeps the bytes of the files that it has read, up to 32 MiB in total, and the SHA-256 of all of
/// them, so that a recording contains what was loaded. It also keeps the meshes themselves until
/// drop_unused(): 12 bytes for a triangle and 24 bytes for a vertex.
///
/// A million triangles take seconds. For large meshes the loader reports each step before it starts, and
/// caches the result on disk (mesh_cache.hpp). Small meshes are neither reported nor cached. Not RT-safe:
/// reads files, may take seconds.
class MeshLoader {
 public:
  using Progress = std::function<void(const std::string&)>;
  /// A mesh with this number of triangles takes about 0.2 s. From here on the loader reports progress and
  /// uses the cache.
  static constexpr std::size_t kLargeMeshTriangles = 50'000;
  static constexpr std::size_t kLargeMeshBytes = 50 * kLargeMeshTriangles;
  /// Total size of the files whose bytes the loader keeps.
  static constexpr std::size_t kMaxKeptBytes = std::size_t{32} << 20;

  MeshLoader() : MeshLoader({}, {}) {}  ///< no cache, no progress reports
  /// cache: directory of the cache; empty: no cache. progress: receives "FILE: ...".
  MeshLoader(std::filesystem::path cache, Progress progress)
      : cache_(std::move(cache)), progress_(std::move(progress)) {}

  /// Restricts the files that are read from now on.
  void set_scope(FileScope scope) { scope_ = std::move(scope); }
  /// Forgets the remarks of earlier scenes, and which meshes they use. Meshes that were loaded stay loaded.
  void begin_scene();
  /// Forgets the meshes that were not used since begin_scene().
  void drop_unused();
  /// Returns the file of this name as it was loaded; null if it was not, or if the mesh is generated.
  const MeshInput* input(const std::filesystem::path& file) const;

  /// Makes load() use these polygons under this name, in place of a file. For meshes of programs.
  void add(const std::filesystem::path& name, PolygonSoup soup);

  /// Returns the mesh of a file, or a generated mesh if `generated` is given; `file` is then its name
  /// (generated_mesh_name()). Throws MeshError that names the file, the defect, its place and the remedy.
  std::shared_ptr<const LoadedMesh> load(const std::filesystem::path& file, BodyKind kind,
                                         const std::optional<GeneratedMesh>& made = {});

  /// Returns the meshes of several files as one body. A solid is the union of all shells of all files
  /// (mesh_union.hpp). A surface consists of all faces. Throws MeshError. Precondition: files is not empty.
  std::shared_ptr<const LoadedMesh> load_parts(const std::vector<std::filesystem::path>& files,
                                               BodyKind kind);

  /// Returns the convex hull in file units.
  ConvexBody hull(const LoadedMesh& loaded);

  /// Returns the surface for contacts and its BVH. mesh: the mesh of `file`, placed and scaled. A solid is
  /// simplified within surface_tolerance_m [m] (mesh_simplifier.hpp); 0: not at all. Then its curved parts
  /// are smoothed (mesh_smoother.hpp).
  std::shared_ptr<const MeshBvh> build_bvh(TriangleMesh mesh, BodyKind kind,
                                           const std::filesystem::path& file, double surface_tolerance_m,
                                           const Smoothing& smoothing = {});

  /// Adds a text to changes() once.
  void add_change(const std::string& change);

  /// Adds a warning if the size of a mesh is implausible.
  void check_size(const LoadedMesh& loaded, double scale, PlausibleSize likely);

  /// The differences between the loaded meshes and their files, each as "FILE: ...": repairs, and use as a
  /// surface.
  const std::vector<std::string>& changes() const noexcept { return changes_; }
  /// The surfaces that contacts use in place of loaded meshes, each as "FILE: ...".
  const std::vector<std::string>& simplifications() const noexcept { return simplifications_; }
  /// Warnings for the user: implausible sizes, and the reason why the cache cannot be written.
  const std::vector<std::string>& warnings() const noexcept { return warnings_; }

 private:
  using Key = std::pair<std::filesystem::path, BodyKind>;

  Key key_of(const std::filesystem::path& file, BodyKind kind, bool is_file) const;
  MeshInput keep(const MeshSource& source);
  std::shared_ptr<const LoadedMesh> use(const Key& key, const std::shared_ptr<const LoadedMesh>& loaded,
                                        const std::vector<std::filesystem::path>& files);
  LoadedMesh read(const std::filesystem::path& file, BodyKind kind);
  LoadedMesh make(const GeneratedMesh& made, const std::filesystem::path& name, BodyKind kind);
  LoadedMesh check_added(const PolygonSoup& soup, const std::filesystem::path& name, BodyKind kind);
  LoadedMesh repair_and_check(PolygonSoup soup, const std::filesystem::path& file, BodyKind kind) const;
  LoadedMesh join_parts(std::vector<MeshSource> sources, BodyKind kind) const;
  std::shared_ptr<const LoadedMesh> with_changes(const std::shared_ptr<const LoadedMesh>& loaded,
                                                 BodyKind kind);
  void report_progress(const std::filesystem::path& file, std::size_t triangles,
                       const std::string& what) const;
  template <class T, class Make>
  T cached(const std::vector<std::string_view>& made_from, bool large, const Make& make);

  MeshCache cache_;
  Progress progress_;
  std::vector<std::string> changes_;
  std::vector<std::string> simplifications_;
  std::vector<std::string> warnings_;
  std::map<std::filesystem::path, std::shared_ptr<const PolygonSoup>>
      added_;  ///< meshes of programs, by name
  std::map<Key, std::shared_ptr<const LoadedMesh>> loaded_;
  FileScope scope_;
  std::set<Key> used_;                                  ///< since begin_scene()
  std::map<std::filesystem::path, MeshInput> inputs_;   ///< by the name that load() received
  std::vector<std::weak_ptr<const std::string>> kept_;  ///< the bytes of the inputs
};

/// Returns why a mesh cannot be used as a body of this kind and how to correct it: "FILE: ...", one line for
/// each defect. soup: the mesh after its repair. Not RT-safe: allocates.
std::string rejection_text(const std::filesystem::path& file, const PolygonSoup& soup, BodyKind kind,
                           const MeshReport& report);

/// Returns how many triangles contacts use in place of a mesh, and how far outside of it they lie: "12 of
/// 60,492 triangles, at most 0.0045 um outside the mesh". triangles: number of triangles of the mesh. Not
/// RT-safe: allocates.
std::string contact_surface_text(std::size_t used, std::size_t triangles, double distance_m);

/// Returns a number with separators: "1,000,000". Not RT-safe: allocates.
std::string with_thousands_separators(std::size_t number);

}  // namespace wrenchd
