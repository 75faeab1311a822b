// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_simplifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "collision/meshes/edge_collapse.hpp"
#include "collision/meshes/flat_regions.hpp"
#include "collision/meshes/half_edge_mesh.hpp"
#include "collision/meshes/self_intersection.hpp"
#include "core/in_parallel.hpp"
#include "core/least_distance.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kMaxStar = EdgeCollapse::kMaxStar;
constexpr double kRounding = EdgeCollapse::kRounding;
/// Corners of a face this close to its plane, as a fraction of the mesh's size, lie in the plane.
constexpr double kSamePlane = 1e-12;
/// Tolerance of flat regions, and the largest displacement of a vertex that makes them planar, as fractions
/// of the full tolerance.
constexpr double kFlatTolerance = 0.02;
constexpr double kMaxFlattening = 0.1;
/// Sine of the angle below which two planes do not determine a line.
constexpr double kMinSine = 1e-3;
/// Tolerances of the passes, as fractions of the full tolerance. Passes with small tolerances first spread
/// the error over the whole surface.
constexpr std::array kPasses = {1e-4, 3e-3, 3e-2, 0.1, 0.3, 1.0};
/// A pass repeats its sweeps until a sweep removes less than this fraction of the vertices.
constexpr double kMinProgress = 0.002;
constexpr int kMaxSweeps = 60;
/// The surface is divided into at most kMaxSurfaceParts parts of at least kMinPartVertices vertices.
constexpr std::size_t kMaxSurfaceParts = 8, kMinPartVertices = 50'000;
/// Number of attempts with a smaller tolerance if the result intersects itself, and the factor between them.
constexpr int kAttempts = 3;
constexpr double kSmallerTolerance = 0.1;

double thinness(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return longest2 > 0.0 ? (b - a).cross(c - a).norm() / longest2 : 0.0;
}

/// Simplifies one mesh: core/METHOD.md, section 14.8.
class Simplifier {
 public:
  Simplifier(TriangleMesh mesh, double tolerance_m)
      : tolerance_m_(tolerance_m), mesh_(std::move(mesh)), faces_(mesh_.face_count()) {
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v)
      size_m_ = std::max(size_m_, mesh_.vertex_m(v).norm());
    if (!mesh_.is_manifold()) return;
    needed_m_.assign(mesh_.half_edge_count(), 0.0F);
    changed_.assign(mesh_.vertex_count(), 0);
    examined_.assign(mesh_.half_edge_count(), -1);
    locked_.assign(mesh_.vertex_count(), -1);
    source_.resize(mesh_.vertex_count());
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) source_[v] = v;
    remaining_ = mesh_.vertex_count();
    divide();
  }

  /// The first pass merges only what is flat to rounding, so that flat faces stay exactly flat.
  SimplifiedMesh run() {
    if (!mesh_.is_manifold()) return result();
    flatten(find_flat_regions(mesh_, kFlatTolerance * tolerance_m_));
    limits_ = {size_m_, tolerance_m_, kRounding * size_m_, tolerance_m_};
    collapse_until_done();
    limits_.max_rise_m = tolerance_m_;
    std::fill(examined_.begin(), examined_.end(), -1);
    for (const double fraction : kPasses) {
      limits_.wanted_m = fraction * tolerance_m_;
      collapse_until_done();
    }
    return result();
  }

 private:
  using Part = std::uint8_t;
  using Planes = LeastDistance<3, kMaxStar>;
  /// What one thread needs to collapse the edges of one part of the surface.
  struct Worker {
    Worker(const HalfEdgeMesh& mesh, const std::vector<FaceState>& faces) : collapse(mesh, faces) {}
    EdgeCollapse collapse;
    std::vector<std::uint32_t> deferred;  ///< half-edges of this part that wait for the seams
    std::size_t collapses = 0;            ///< in this sweep
  };

  /// Collapses edges until a sweep finds few more.
  void collapse_until_done() {
    for (int sweep = 0; sweep < kMaxSweeps; ++sweep)
      if (static_cast<double>(collapse_edges()) <= kMinProgress * static_cast<double>(remaining_)) break;
  }

  SimplifiedMesh result() const {
    SimplifiedMesh result;
    std::vector<std::uint32_t> number(mesh_.vertex_count(), HalfEdgeMesh::kNone);
    std::vector<bool> used(mesh_.vertex_count(), false);
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f)
      if (!mesh_.removed(f))
        for (const std::uint32_t v : mesh_.corners(f)) used[v] = true;
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) {
      if (!used[v]) continue;
      number[v] = static_cast<std::uint32_t>(result.mesh.vertices_m.size());
      result.mesh.vertices_m.push_back(mesh_.vertex_m(v));
      result.source_vertex.push_back(source_.empty() ? v : source_[v]);
    }
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f) {
      if (mesh_.removed(f)) continue;
      const auto& [a, b, c] = mesh_.corners(f);
      result.mesh.triangles.push_back({number[a], number[b], number[c]});
      result.source_triangle.push_back(f);
      result.distance_m = std::max(result.distance_m, faces_[f].high_m);
    }
    return result;
  }

  /// Moves each vertex onto the planes of its flat regions. Thus flat regions become planar, and the rounding
  /// of their coordinates no longer tilts their triangles.
  void flatten(const FlatRegions& regions) {
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f)
      faces_[f].plane = regions.planes[regions.region_of_face[f]];
    std::vector<double> moved_m(mesh_.vertex_count(), 0.0);
    const std::size_t threads = threads_for(mesh_.vertex_count(), kMinPartVertices);
    in_parallel(threads, threads, [&](std::size_t part) {
      Planes planes;
      const std::size_t count = mesh_.vertex_count();
      for (auto v = static_cast<std::uint32_t>(part * count / threads); v < (part + 1) * count / threads; ++v)
        moved_m[v] = flatten(v, regions, planes);
    });
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f) {
      for (const std::uint32_t v : mesh_.corners(f))
        faces_[f].high_m = std::max(faces_[f].high_m, moved_m[v]);
      update_face(f);
    }
  }

  /// Moves one vertex. Returns its displacement [m].
  double flatten(std::uint32_t v, const FlatRegions& regions, Planes& planes) {
    if (mesh_.valence(v) == 0 || mesh_.valence(v) > kMaxStar) return 0.0;
    StaticVector<std::uint32_t, kMaxStar> around;
    mesh_.for_each_outgoing(v, [&](std::uint32_t h) {
      const std::uint32_t region = regions.region_of_face[HalfEdgeMesh::face_of(h)];
      if (std::find(around.begin(), around.end(), region) == around.end()) around.add(region);
    });
    const std::optional<Vector3d> z_m = displacement_onto(regions, around, mesh_.vertex_m(v), planes);
    if (!z_m || z_m->norm() > kMaxFlattening * tolerance_m_ || z_m->norm() <= kSamePlane * size_m_)
      return 0.0;
    mesh_.move_vertex(v, mesh_.vertex_m(v) + *z_m);
    return z_m->norm();
  }

  /// Returns the displacement of a vertex onto the planes of the regions around it. It meets the planes of
  /// the two largest regions exactly, the third one if no other plane prevents it, and lies on or above the
  /// others.
  std::optional<Vector3d> displacement_onto(const FlatRegions& regions,
                                            const StaticVector<std::uint32_t, kMaxStar>& around,
                                            const Vector3d& p_m, Planes& problem) const {
    std::array<std::uint32_t, kMaxStar> order{};
    std::copy(around.begin(), around.end(), order.begin());
    std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(around.size()),
              [&](std::uint32_t a, std::uint32_t b) { return regions.areas_m2[a] > regions.areas_m2[b]; });
    problem.clear();
    for (std::size_t i = 0; i < around.size(); ++i) {
      const FlatRegions::Plane& plane = regions.planes[order[i]];
      problem.add_unit(plane.normal, plane.offset_m - plane.normal.dot(p_m));
    }
    const std::optional<Vector3d> z_m = displacement_onto_two_planes(problem);
    if (z_m && z_m->norm() <= kMaxFlattening * tolerance_m_) return z_m;
    if (problem.solve(Vector3d::Zero(), kRounding * size_m_) != Planes::Status::optimal) return {};
    return problem.z();
  }

  /// Solves for the planes in `problem`: the first two determine a line (one plane alone: a point), and the
  /// others limit the position on the line. Returns nothing if no point of the line is above all of them.
  std::optional<Vector3d> displacement_onto_two_planes(const Planes& problem) const {
    const Vector3d z_m = problem.normal(0) * problem.bound(0);
    if (problem.count() == 1) return z_m;
    const Vector3d &a = problem.normal(0), &b = problem.normal(1);
    const Vector3d across = a.cross(b);
    const double sine = across.norm();
    if (sine < kMinSine) return {};
    const Vector3d direction = across / sine, in_plane = direction.cross(a);
    const Vector3d on_line_m = z_m + in_plane * ((problem.bound(1) - b.dot(z_m)) / b.dot(in_plane));
    double least_m = -std::numeric_limits<double>::infinity(), most_m = -least_m, wanted_m = 0.0;
    for (std::size_t i = 2; i < problem.count(); ++i) {
      const double slope = problem.normal(i).dot(direction);
      const double missing_m = problem.bound(i) - problem.normal(i).dot(on_line_m);
      if (std::abs(slope) < kMinSine) {
        if (missing_m > kRounding * size_m_) return {};
        continue;
      }
      const double at_m = missing_m / slope;
      if (i == 2) wanted_m = at_m;
      if (slope > 0.0)
        least_m = std::max(least_m, at_m);
      else
        most_m = std::min(most_m, at_m);
    }
    if (least_m > most_m) return {};
    return on_line_m + direction * std::clamp(wanted_m, least_m, most_m);
  }

  /// A face that still lies in its plane keeps it. So the planes of a flat region stay equal.
  void update_face(std::uint32_t f) {
    const auto& [a, b, c] = mesh_.corners(f);
    const Vector3d &p = mesh_.vertex_m(a), &q = mesh_.vertex_m(b), &r = mesh_.vertex_m(c);
    FaceState& state = faces_[f];
    state.thinness = thinness(p, q, r);
    const auto distance_m = [&](const Vector3d& x) {
      return std::abs(state.plane.normal.dot(x) - state.plane.offset_m);
    };
    if (std::max({distance_m(p), distance_m(q), distance_m(r)}) <= kSamePlane * size_m_) return;
    state.plane.normal = (q - p).cross(r - p).normalized();
    state.plane.offset_m = state.plane.normal.dot(p);
  }

  /// Tries to collapse every edge once. The surroundings of a collapse stay as they are until the next call,
  /// so that the error spreads evenly. Returns the number of collapses.
  ///
  /// The parts of the surface are collapsed at the same time. A collapse reads and changes what belongs to
  /// the vertices of its star, so it may take place in a part that contains all of them. What remains, along
  /// the seams between the parts, follows when the parts are done.
  std::size_t collapse_edges() {
    ++sweep_;
    assign_faces();
    in_parallel(workers_.size() - 1, threads_for(mesh_.vertex_count(), kMinPartVertices),
                [this](std::size_t part) { collapse_part(static_cast<Part>(part)); });
    const auto seam = static_cast<Part>(workers_.size() - 1);
    collapse_part(seam);
    for (Part part = 0; part < seam; ++part)
      for (const std::uint32_t h : workers_[part].deferred) try_to_collapse(h, seam);
    std::size_t collapses = 0;
    for (const Worker& worker : workers_) collapses += worker.collapses;
    remaining_ -= collapses;
    return collapses;
  }

  void collapse_part(Part part) {
    workers_[part].deferred.clear();
    workers_[part].collapses = 0;
    for (std::uint32_t h = 0; h < mesh_.half_edge_count(); ++h)
      if (part_of_face_[HalfEdgeMesh::face_of(h)] == part) try_to_collapse(h, part);
  }

  /// Divides the vertices into parts of about equal size along the longest side of the mesh. The number of
  /// parts depends on the mesh alone, and with it the result.
  void divide() {
    const std::size_t parts =
        std::clamp<std::size_t>(mesh_.vertex_count() / kMinPartVertices, 1, kMaxSurfaceParts);
    for (std::size_t part = 0; part <= parts; ++part) workers_.emplace_back(mesh_, faces_);
    part_of_vertex_.assign(mesh_.vertex_count(), 0);
    part_of_face_.assign(mesh_.face_count(), 0);
    if (parts == 1) return;
    Eigen::AlignedBox3d box;
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) box.extend(mesh_.vertex_m(v));
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    std::vector<double> along_m(mesh_.vertex_count());
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) along_m[v] = mesh_.vertex_m(v)[axis];
    for (std::size_t part = 1; part < parts; ++part) {
      std::vector<double> sorted_m = along_m;
      const auto at = sorted_m.begin() + static_cast<std::ptrdiff_t>(part * sorted_m.size() / parts);
      std::nth_element(sorted_m.begin(), at, sorted_m.end());
      for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v)
        if (along_m[v] >= *at) part_of_vertex_[v] = static_cast<Part>(part);
    }
  }

  /// Assigns each face to the part of its corners, or to the seams if they are in several parts.
  void assign_faces() {
    const auto seam = static_cast<Part>(workers_.size() - 1);
    if (seam == 1) return;
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f) {
      if (mesh_.removed(f)) continue;
      const auto& [a, b, c] = mesh_.corners(f);
      const Part part = part_of_vertex_[a];
      part_of_face_[f] = part_of_vertex_[b] == part && part_of_vertex_[c] == part ? part : seam;
    }
  }

  /// True if the star of an edge lies in one part.
  bool is_within(Part part, std::uint32_t u, std::uint32_t w) const {
    if (workers_.size() == 2) return true;
    bool within = true;
    for (const std::uint32_t v : {u, w})
      mesh_.for_each_outgoing(
          v, [&](std::uint32_t h) { within = within && part_of_vertex_[mesh_.to(h)] == part; });
    return within;
  }

  void try_to_collapse(std::uint32_t h, Part part) {
    if (mesh_.removed(HalfEdgeMesh::face_of(h))) return;
    const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
    if (u > w || locked_[u] == sweep_ || locked_[w] == sweep_) return;
    const bool is_examined = examined_[h] > std::max(changed_[u], changed_[w]);
    if (is_examined && needed_m_[h] > limits_.wanted_m) return;
    Worker& worker = workers_[part];
    if (part + 1U < workers_.size() && !is_within(part, u, w)) {
      worker.deferred.push_back(h);
      return;
    }
    examined_[h] = sweep_;
    needed_m_[h] = std::numeric_limits<float>::infinity();
    if (limits_.max_rise_m < tolerance_m_ && is_corner(u) && is_corner(w)) return;
    const std::optional<EdgeCollapse::Candidate> best = worker.collapse.find(h, limits_);
    needed_m_[h] = static_cast<float>(worker.collapse.needed_m());
    if (!best) return;
    apply(h, *best, worker.collapse);
    ++worker.collapses;
  }

  /// True if the faces around a vertex have three planes or more. Such a vertex is not removed from a surface
  /// that must not change.
  bool is_corner(std::uint32_t v) const {
    StaticVector<const FlatRegions::Plane*, 3> planes;
    mesh_.for_each_outgoing(v, [&](std::uint32_t h) {
      const FlatRegions::Plane& plane = faces_[HalfEdgeMesh::face_of(h)].plane;
      const auto is_known = [&](const FlatRegions::Plane* known) {
        return known->normal == plane.normal && known->offset_m == plane.offset_m;
      };
      if (!planes.full() && std::none_of(planes.begin(), planes.end(), is_known)) planes.add(&plane);
    });
    return planes.full();
  }

  void apply(std::uint32_t h, const EdgeCollapse::Candidate& candidate, const EdgeCollapse& collapse) {
    const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
    if (!collapse.is_nearer_to_u(candidate)) source_[u] = source_[w];
    mesh_.collapse(h, candidate.p_m);
    collapse.for_each_remaining_face([&](std::uint32_t f) {
      faces_[f].high_m = candidate.high_m;
      faces_[f].low_m = candidate.low_m;
      update_face(f);
    });
    // Every edge with an end on the ring sees another star now.
    changed_[u] = locked_[u] = sweep_;
    mesh_.for_each_outgoing(u,
                            [&](std::uint32_t g) { changed_[mesh_.to(g)] = locked_[mesh_.to(g)] = sweep_; });
  }

  double tolerance_m_;
  double size_m_ = 0.0;
  EdgeCollapse::Limits limits_{};
  HalfEdgeMesh mesh_;
  std::vector<FaceState> faces_;
  std::vector<float> needed_m_;  ///< for each half-edge: tolerance that its collapse needs [m]
  std::vector<int> examined_;    ///< for each half-edge: sweep of the last examination
  std::vector<int> changed_;     ///< for each vertex: sweep in which its faces changed last
  std::vector<int> locked_;      ///< for each vertex: sweep in which it must not change any more
  std::vector<std::uint32_t> source_;
  int sweep_ = 0;
  std::size_t remaining_ = 0;
  std::vector<Worker> workers_;       ///< one for each part, and the last one for the seams
  std::vector<Part> part_of_vertex_;  ///< does not change
  std::vector<Part> part_of_face_;    ///< at the begin of a sweep
};

SimplifiedMesh unchanged(TriangleMesh mesh) {
  SimplifiedMesh result;
  result.source_vertex.resize(mesh.vertices_m.size());
  std::iota(result.source_vertex.begin(), result.source_vertex.end(), 0U);
  result.source_triangle.resize(mesh.triangles.size());
  std::iota(result.source_triangle.begin(), result.source_triangle.end(), 0U);
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace

double simplification_tolerance_m(const TriangleMesh& mesh, double tolerance_m) {
  constexpr double kSinglePrecision = 0x1p-24;
  constexpr double kMaxOfSize = 1e-4;
  Eigen::AlignedBox3d box;
  double largest_m = 0.0;
  for (const Vector3d& p : mesh.vertices_m) {
    box.extend(p);
    largest_m = std::max(largest_m, p.cwiseAbs().maxCoeff());
  }
  if (box.isEmpty() || !(tolerance_m > 0.0)) return 0.0;
  return std::min(std::max(tolerance_m, kSinglePrecision * largest_m), kMaxOfSize * box.diagonal().norm());
}

SimplifiedMesh simplify_enclosing(TriangleMesh mesh, double tolerance_m) {
  double attempted_m = tolerance_m;
  for (int attempt = 0; attempt < kAttempts; ++attempt, attempted_m *= kSmallerTolerance) {
    SimplifiedMesh result = Simplifier(mesh, attempted_m).run();
    // Parts of the surface that are closer together than the tolerance may have grown into each other.
    if (result.mesh.triangles.size() == mesh.triangles.size() && result.distance_m == 0.0) break;
    if (!intersects_itself(result.mesh)) return result;
  }
  return unchanged(std::move(mesh));
}

}  // namespace wrenchd
