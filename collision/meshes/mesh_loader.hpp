// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_bvh.hpp"
#include "collision/meshes/mesh_cache.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_size.hpp"
#include "core/convex_body.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A mesh file that was read, repaired and checked; or a mesh that was made, and checked like one.
struct LoadedMesh {
  std::filesystem::path file;
  TriangleMesh mesh;                 ///< in the file's own units
  std::vector<std::string> repairs;  ///< what was repaired (collision/meshes/mesh_repair.hpp)
};

/// Reads meshes and makes of them what contacts need. A file is read once, however many bodies it is.
///
/// A million triangles take seconds: what is about to be done with a large mesh is told beforehand, and what
/// comes out is kept on disk (collision/meshes/mesh_cache.hpp). Nothing is told of small ones, and nothing
/// kept. Not RT safe.
class MeshLoader {
 public:
  using Progress = std::function<void(const std::string&)>;
  /// From here on a mesh takes long enough to be told of, and to be worth keeping: a fifth of a second.
  static constexpr std::size_t kLargeMeshTriangles = 50'000;
  static constexpr std::size_t kLargeMeshBytes = 50 * kLargeMeshTriangles;

  MeshLoader() : MeshLoader({}, {}) {}  ///< keeps nothing and tells nothing
  /// cache: a directory; empty: nothing is kept. progress: is given "FILE: ...".
  MeshLoader(std::filesystem::path cache, Progress progress)
      : cache_(std::move(cache)), progress_(std::move(progress)) {}

  /// made: what is to be made in the place of the file, whose name is name_of() it. Throws MeshError that
  /// names the file, the defect, its place and the cure.
  std::shared_ptr<const LoadedMesh> load(const std::filesystem::path& file, BodyKind kind,
                                         const std::optional<GeneratedMesh>& made = {});

  /// The convex hull, in file units.
  ConvexBody hull(const LoadedMesh& loaded);

  /// The surface and its tree. mesh: of that file, placed and scaled.
  std::shared_ptr<const MeshBvh> build_bvh(TriangleMesh mesh, BodyKind kind,
                                           const std::filesystem::path& file);

  /// Remarks on a size that is not likely.
  void check_size(const LoadedMesh& loaded, double scale, PlausibleSize likely);

  /// How the meshes loaded so far differ from their files, each as "FILE: ...": what was repaired, and which
  /// are surfaces.
  const std::vector<std::string>& changes() const noexcept { return changes_; }
  /// What else a person should know of them: sizes that are not likely, and why nothing is kept on disk.
  const std::vector<std::string>& warnings() const noexcept { return warnings_; }

 private:
  LoadedMesh read(const std::filesystem::path& file, BodyKind kind);
  LoadedMesh make(const GeneratedMesh& made, const std::filesystem::path& name, BodyKind kind);
  LoadedMesh repair_and_check(PolygonSoup soup, const std::filesystem::path& file, BodyKind kind) const;
  void report_progress(const std::filesystem::path& file, std::size_t triangles,
                       const std::string& what) const;
  template <class T, class Make>
  T cached(const std::vector<std::string_view>& made_from, bool large, const Make& make);

  MeshCache cache_;
  Progress progress_;
  std::vector<std::string> changes_;
  std::vector<std::string> warnings_;
  std::map<std::pair<std::filesystem::path, BodyKind>, std::shared_ptr<const LoadedMesh>> loaded_;
};

/// Why a mesh cannot be used as a body of this kind, and what can be done about it: "FILE: ...", a line for
/// each defect. soup: as it was repaired.
std::string rejection_text(const std::filesystem::path& file, const PolygonSoup& soup, BodyKind kind,
                           const MeshReport& report);

/// "1,000,000", for people.
std::string with_thousands_separators(std::size_t number);

}  // namespace wrenchd
