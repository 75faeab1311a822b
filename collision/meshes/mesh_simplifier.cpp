// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_simplifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <Eigen/Geometry>

#include "collision/meshes/flat_regions.hpp"
#include "collision/meshes/half_edge_mesh.hpp"
#include "core/least_distance.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {
namespace {

/// Maximum number of faces around an edge. An edge with more faces is not collapsed.
constexpr std::size_t kMaxValence = 64;
constexpr std::size_t kMaxStar = kMaxValence;
/// Every face around a collapsed edge must face the mean direction by at least this cosine.
constexpr double kMinFacing = 0.05;
/// Minimum altitude of a new triangle as a fraction of its longest side, unless its predecessors are thinner.
constexpr double kMinAltitude = 1e-5;
/// Because of rounding, a new vertex may lie below a plane that it should enclose by this fraction of the
/// mesh's size in one collapse, and a face may lie below the original surface by kMaxUndercut_m.
constexpr double kRounding = 2e-13;
constexpr double kMaxUndercut_m = 2e-10;
/// Corners of a face this close to its plane, as a fraction of the mesh's size, lie in the plane.
constexpr double kSamePlane = 1e-12;
/// A collapse that changes the surface by at most this is exact for contact queries [m].
constexpr double kExact_m = 1e-12;
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
/// Number of attempts with a smaller tolerance if the result intersects itself, and the factor between them.
constexpr int kAttempts = 3;
constexpr double kSmallerTolerance = 0.1;

/// What is known of a face of the simplified mesh.
struct FaceState {
  FlatRegions::Plane plane;
  /// bounds for the signed distance of the face from the original surface, positive outside [m]
  double high_m = 0.0, low_m = 0.0;
  double thinness = 0.0;  ///< altitude / longest side
};

double thinness(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return longest2 > 0.0 ? (b - a).cross(c - a).norm() / longest2 : 0.0;
}

/// The faces around an edge from u to w before its collapse. The collapse replaces them by the faces between
/// a new vertex and the ring, the border of the star.
struct Star {
  struct Face {
    std::uint32_t number;
    Vector3d a, b, c;
    Vector3d normal;
    double offset_m;
    bool survives;                ///< false for the two faces at the edge
    Vector3d ring_from, ring_to;  ///< its side on the ring, if it survives and has one corner at the edge
  };
  StaticVector<Face, kMaxStar> faces;
  StaticVector<Vector3d, kMaxStar> ring;
  /// the edges from u and from w to the ring, and the edge from u to w
  StaticVector<std::pair<Vector3d, Vector3d>, 2 * kMaxStar> inner_edges;
  Vector3d u, w;
  Vector3d mean_normal;
  double high_m = 0.0, low_m = 0.0;  ///< bounds of all its faces, see FaceState
  double thinnest = 1.0;
};

/// A position for the merged vertex and the bounds for the new faces, see FaceState.
struct Placement {
  Vector3d p_m;
  double high_m, low_m;
};

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
    evaluated_.assign(mesh_.half_edge_count(), -1);
    locked_.assign(mesh_.vertex_count(), -1);
    source_.resize(mesh_.vertex_count());
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) source_[v] = v;
    remaining_ = mesh_.vertex_count();
  }

  /// The first pass merges only what is flat to rounding, so that flat faces stay exactly flat.
  SimplifiedMesh run() {
    if (!mesh_.is_manifold()) return result();
    flatten(find_flat_regions(mesh_, kFlatTolerance * tolerance_m_));
    max_rise_m_ = kRounding * size_m_;
    run_pass(tolerance_m_);
    max_rise_m_ = tolerance_m_;
    std::fill(evaluated_.begin(), evaluated_.end(), -1);
    for (const double fraction : kPasses) run_pass(fraction * tolerance_m_);
    return result();
  }

 private:
  /// Collapses edges until a sweep finds few more.
  void run_pass(double tolerance_m) {
    pass_tolerance_m_ = tolerance_m;
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
    for (std::uint32_t v = 0; v < mesh_.vertex_count(); ++v) {
      if (mesh_.valence(v) == 0 || mesh_.valence(v) > kMaxStar) continue;
      StaticVector<std::uint32_t, kMaxStar> around;
      mesh_.for_each_outgoing(v, [&](std::uint32_t h) {
        const std::uint32_t region = regions.region_of_face[HalfEdgeMesh::face_of(h)];
        if (std::find(around.begin(), around.end(), region) == around.end()) around.add(region);
      });
      const std::optional<Vector3d> z_m = displacement_onto(regions, around, mesh_.vertex_m(v));
      if (!z_m || z_m->norm() > kMaxFlattening * tolerance_m_ || z_m->norm() <= kSamePlane * size_m_)
        continue;
      moved_m[v] = z_m->norm();
      mesh_.move_vertex(v, mesh_.vertex_m(v) + *z_m);
    }
    for (std::uint32_t f = 0; f < mesh_.face_count(); ++f) {
      for (const std::uint32_t v : mesh_.corners(f))
        faces_[f].high_m = std::max(faces_[f].high_m, moved_m[v]);
      update_face(f);
    }
  }

  /// Returns the displacement of a vertex onto the planes of the regions around it. It meets the planes of
  /// the two largest regions exactly, the third one if no other plane prevents it, and lies on or above the
  /// others.
  std::optional<Vector3d> displacement_onto(const FlatRegions& regions,
                                            const StaticVector<std::uint32_t, kMaxStar>& around,
                                            const Vector3d& p_m) {
    std::array<std::uint32_t, kMaxStar> order{};
    std::copy(around.begin(), around.end(), order.begin());
    std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(around.size()),
              [&](std::uint32_t a, std::uint32_t b) { return regions.areas_m2[a] > regions.areas_m2[b]; });
    problem_.clear();
    for (std::size_t i = 0; i < around.size(); ++i) {
      const FlatRegions::Plane& plane = regions.planes[order[i]];
      problem_.add_unit(plane.normal, plane.offset_m - plane.normal.dot(p_m));
    }
    const std::optional<Vector3d> z_m = displacement_onto_two_planes();
    if (z_m && z_m->norm() <= kMaxFlattening * tolerance_m_) return z_m;
    if (problem_.solve(Vector3d::Zero(), kRounding * size_m_) != decltype(problem_)::Status::optimal)
      return {};
    return problem_.z();
  }

  /// Solves for the planes in problem_: the first two determine a line (one plane alone: a point), and the
  /// others limit the position on the line. Returns nothing if no point of the line is above all of them.
  std::optional<Vector3d> displacement_onto_two_planes() const {
    const Vector3d z_m = problem_.normal(0) * problem_.bound(0);
    if (problem_.count() == 1) return z_m;
    const Vector3d &a = problem_.normal(0), &b = problem_.normal(1);
    const Vector3d across = a.cross(b);
    const double sine = across.norm();
    if (sine < kMinSine) return {};
    const Vector3d direction = across / sine, in_plane = direction.cross(a);
    const Vector3d on_line_m = z_m + in_plane * ((problem_.bound(1) - b.dot(z_m)) / b.dot(in_plane));
    double least_m = -std::numeric_limits<double>::infinity(), most_m = -least_m, wanted_m = 0.0;
    for (std::size_t i = 2; i < problem_.count(); ++i) {
      const double slope = problem_.normal(i).dot(direction);
      const double missing_m = problem_.bound(i) - problem_.normal(i).dot(on_line_m);
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
  std::size_t collapse_edges() {
    ++sweep_;
    std::size_t collapses = 0;
    for (std::uint32_t h = 0; h < mesh_.half_edge_count(); ++h) {
      if (mesh_.removed(HalfEdgeMesh::face_of(h))) continue;
      const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
      if (u > w || locked_[u] == sweep_ || locked_[w] == sweep_) continue;
      const bool current = evaluated_[h] > std::max(changed_[u], changed_[w]);
      if (current && needed_m_[h] > pass_tolerance_m_) continue;
      evaluated_[h] = sweep_;
      needed_m_[h] = std::numeric_limits<float>::infinity();
      if (!keeps_manifold(h) || !gather(h)) continue;
      const std::optional<Placement> best = best_placement(h);
      if (!best) continue;
      apply(h, *best);
      ++collapses;
    }
    remaining_ -= collapses;
    return collapses;
  }

  /// The link condition: u and w have only the two opposite corners of their faces as common neighbours.
  bool keeps_manifold(std::uint32_t h) {
    const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
    if (mesh_.valence(u) + mesh_.valence(w) > kMaxValence) return false;
    for (const std::uint32_t g : {h, mesh_.twin(h)})
      if (mesh_.valence(mesh_.to(HalfEdgeMesh::next(g))) <= 3) return false;
    neighbours_.clear();
    mesh_.for_each_outgoing(u, [&](std::uint32_t g) { neighbours_.add(mesh_.to(g)); });
    int common = 0;
    mesh_.for_each_outgoing(w, [&](std::uint32_t g) {
      if (std::find(neighbours_.begin(), neighbours_.end(), mesh_.to(g)) != neighbours_.end()) ++common;
    });
    if (common != 2) return false;
    return true;
  }

  /// Collects the star of an edge. Returns false if it cannot be projected onto a plane one to one.
  bool gather(std::uint32_t h) {
    const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
    star_.faces.clear();
    star_.ring.clear();
    star_.inner_edges.clear();
    star_.u = mesh_.vertex_m(u);
    star_.w = mesh_.vertex_m(w);
    star_.mean_normal.setZero();
    star_.high_m = 0.0;
    star_.low_m = std::numeric_limits<double>::infinity();
    star_.thinnest = 1.0;
    const std::uint32_t face_0 = HalfEdgeMesh::face_of(h), face_1 = HalfEdgeMesh::face_of(mesh_.twin(h));
    const auto add = [&](std::uint32_t g) {
      const std::uint32_t f = HalfEdgeMesh::face_of(g);
      const auto& [a, b, c] = mesh_.corners(f);
      const bool survives = f != face_0 && f != face_1;
      const FaceState& state = faces_[f];
      const Vector3d& ring_from = mesh_.vertex_m(mesh_.to(g));
      star_.faces.add({f, mesh_.vertex_m(a), mesh_.vertex_m(b), mesh_.vertex_m(c), state.plane.normal,
                       state.plane.offset_m, survives, ring_from,
                       mesh_.vertex_m(mesh_.from(HalfEdgeMesh::previous(g)))});
      star_.mean_normal += state.plane.normal;
      star_.high_m = std::max(star_.high_m, state.high_m);
      star_.low_m = std::min(star_.low_m, state.low_m);
      star_.thinnest = std::min(star_.thinnest, state.thinness);
    };
    mesh_.for_each_outgoing(u, [&](std::uint32_t g) {
      add(g);
      if (mesh_.to(g) == w) return;
      star_.ring.add(mesh_.vertex_m(mesh_.to(g)));
      star_.inner_edges.add({star_.u, mesh_.vertex_m(mesh_.to(g))});
    });
    mesh_.for_each_outgoing(w, [&](std::uint32_t g) {
      if (HalfEdgeMesh::face_of(g) != face_0 && HalfEdgeMesh::face_of(g) != face_1) add(g);
      if (mesh_.to(g) == u) return;
      star_.inner_edges.add({star_.w, mesh_.vertex_m(mesh_.to(g))});
      if (g != HalfEdgeMesh::next(h) && mesh_.to(g) != mesh_.to(HalfEdgeMesh::next(mesh_.twin(h))))
        star_.ring.add(mesh_.vertex_m(mesh_.to(g)));
    });
    star_.inner_edges.add({star_.u, star_.w});
    const double length = star_.mean_normal.norm();
    if (!(length > 0.0)) return false;
    star_.mean_normal /= length;
    return std::all_of(star_.faces.begin(), star_.faces.end(), [&](const Star::Face& face) {
      return face.normal.dot(star_.mean_normal) >= kMinFacing;
    });
  }

  /// Tries both ends of the edge, then the enclosing point nearest to its middle.
  std::optional<Placement> best_placement(std::uint32_t h) {
    std::optional<Placement> best;
    const auto try_at = [&](const Vector3d& p_m) {
      const std::optional<Placement> placement = evaluate(p_m);
      if (!placement) return;
      needed_m_[h] = std::min(needed_m_[h], static_cast<float>(placement->high_m));
      if (placement->high_m <= pass_tolerance_m_ && (!best || placement->high_m < best->high_m))
        best = placement;
    };
    try_at(star_.u);
    if (best && best->high_m <= star_.high_m + kExact_m) return best;
    try_at(star_.w);
    if (best && best->high_m <= star_.high_m + kExact_m) return best;
    if (const auto p_m = nearest_enclosing_point()) try_at(*p_m);
    return best;
  }

  /// Returns the point nearest to the middle of the edge that lies below no plane of the star.
  std::optional<Vector3d> nearest_enclosing_point() {
    const Vector3d middle = 0.5 * (star_.u + star_.w);
    problem_.clear();
    for (const Star::Face& face : star_.faces)
      problem_.add_unit(face.normal, face.offset_m - face.normal.dot(middle));
    if (problem_.solve(Vector3d::Zero(), 0.1 * kRounding * size_m_) != decltype(problem_)::Status::optimal)
      return {};
    return middle + problem_.z();
  }

  /// Returns the bounds for the new faces with the merged vertex at p; nothing if p is not allowed.
  std::optional<Placement> evaluate(const Vector3d& p) const {
    double lowest_m = 0.0, highest_m = 0.0;
    for (const Star::Face& face : star_.faces) {
      const double height_m = face.normal.dot(p) - face.offset_m;
      lowest_m = std::min(lowest_m, height_m);
      highest_m = std::max(highest_m, height_m / face.normal.dot(star_.mean_normal));
    }
    if (lowest_m < -kRounding * size_m_) return {};
    const double low_m = star_.low_m + lowest_m;
    if (low_m < -kMaxUndercut_m || !new_faces_are_valid(p)) return {};
    for (const Star::Face& face : star_.faces)
      for (const Vector3d& r : star_.ring)
        highest_m =
            std::max(highest_m, (face.normal.dot(r) - face.offset_m) / face.normal.dot(star_.mean_normal));
    if (highest_m > kExact_m) highest_m = std::min(highest_m, largest_rise_m(p));
    if (highest_m > max_rise_m_) return {};
    return Placement{p, star_.high_m + highest_m, low_m};
  }

  /// The new faces project onto the plane of the mean normal without overlap, and none is a needle.
  bool new_faces_are_valid(const Vector3d& p) const {
    const double min_thinness = std::min(kMinAltitude, star_.thinnest);
    return std::all_of(star_.faces.begin(), star_.faces.end(), [&](const Star::Face& face) {
      if (!face.survives) return true;
      const Vector3d area = (face.ring_from - p).cross(face.ring_to - p);
      const double length = area.norm();
      return area.dot(star_.mean_normal) > kMinFacing * length &&
             thinness(p, face.ring_from, face.ring_to) >= min_thinness;
    });
  }

  /// Returns the largest height of the new faces above the old ones, along the mean normal. Both surfaces are
  /// graphs of piecewise linear functions over the same polygon. So the largest difference occurs at the new
  /// vertex, at a removed vertex, or where a new edge crosses an old one: METHOD (97).
  double largest_rise_m(const Vector3d& p) const {
    constexpr double kUnknown = std::numeric_limits<double>::infinity();
    const Vector3d& n = star_.mean_normal;
    double rise_m = 0.0;
    bool found = false;
    for (const Star::Face& face : star_.faces) {
      if (!projects_inside(p, face.a, face.b, face.c)) continue;
      rise_m = std::max(rise_m, (face.normal.dot(p) - face.offset_m) / face.normal.dot(n));
      found = true;
    }
    if (!found) return kUnknown;
    if (star_.high_m + rise_m > tolerance_m_) return rise_m;  // every pass refuses it
    for (const Vector3d* removed : {&star_.u, &star_.w}) {
      found = false;
      for (const Star::Face& face : star_.faces) {
        if (!face.survives || !projects_inside(*removed, p, face.ring_from, face.ring_to)) continue;
        const Vector3d normal = (face.ring_from - p).cross(face.ring_to - p);
        rise_m = std::max(rise_m, normal.dot(p - *removed) / normal.dot(n));
        found = true;
      }
      if (!found) return kUnknown;
    }
    for (const Vector3d& r : star_.ring)
      for (const auto& [from, to] : star_.inner_edges) {
        // Solves p + s (r - p) = from + t (to - from) + rise n.
        const Vector3d spoke = r - p, old = to - from, between = from - p;
        const Vector3d across = old.cross(n);
        const double slope = spoke.dot(across);
        if (slope == 0.0) continue;
        const double s = between.dot(across) / slope;
        const double t = between.cross(spoke).dot(n) / spoke.cross(old).dot(n);
        if (s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0)
          rise_m = std::max(rise_m, n.dot(s * spoke - between - t * old));
      }
    return rise_m;
  }

  /// Returns true if x projects into the triangle along the mean normal, or onto its border.
  bool projects_inside(const Vector3d& x, const Vector3d& a, const Vector3d& b, const Vector3d& c) const {
    const Vector3d& n = star_.mean_normal;
    const double u = n.dot((b - a).cross(x - a)), v = n.dot((c - b).cross(x - b)),
                 w = n.dot((a - c).cross(x - c));
    const double rounding = -1e-12 * n.dot((b - a).cross(c - a));
    return u >= rounding && v >= rounding && w >= rounding;
  }

  void apply(std::uint32_t h, const Placement& placement) {
    const std::uint32_t u = mesh_.from(h), w = mesh_.to(h);
    if ((placement.p_m - star_.w).squaredNorm() < (placement.p_m - star_.u).squaredNorm())
      source_[u] = source_[w];
    mesh_.collapse(h, placement.p_m);
    for (const Star::Face& face : star_.faces) {
      if (!face.survives) continue;
      faces_[face.number].high_m = placement.high_m;
      faces_[face.number].low_m = placement.low_m;
      update_face(face.number);
    }
    // Every edge with an end on the ring sees another star now.
    changed_[u] = locked_[u] = sweep_;
    mesh_.for_each_outgoing(u,
                            [&](std::uint32_t g) { changed_[mesh_.to(g)] = locked_[mesh_.to(g)] = sweep_; });
  }

  double tolerance_m_;
  double pass_tolerance_m_ = 0.0;  ///< a collapse must leave faces no farther than this from the original [m]
  double max_rise_m_ = 0.0;        ///< a collapse must not raise the surface by more than this [m]
  double size_m_ = 0.0;
  HalfEdgeMesh mesh_;
  std::vector<FaceState> faces_;
  std::vector<float> needed_m_;  ///< for each half-edge: tolerance that its collapse needs [m]
  std::vector<int> evaluated_;   ///< for each half-edge: sweep of the last evaluation
  std::vector<int> changed_;     ///< for each vertex: sweep in which its faces changed last
  std::vector<int> locked_;      ///< for each vertex: sweep in which it must not change any more
  std::vector<std::uint32_t> source_;
  int sweep_ = 0;
  std::size_t remaining_ = 0;
  StaticVector<std::uint32_t, kMaxValence> neighbours_;
  Star star_;
  LeastDistance<3, kMaxStar> problem_;
};

/// Returns true if two triangles of a closed mesh intersect beyond a common vertex or edge.
bool intersects_itself(const TriangleMesh& mesh) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  std::vector<Kernel::Point_3> points;
  points.reserve(mesh.vertices_m.size());
  for (const Vector3d& p : mesh.vertices_m) points.emplace_back(p.x(), p.y(), p.z());
  CGAL::Surface_mesh<Kernel::Point_3> surface;
  for (const auto& p : points) surface.add_vertex(p);
  using Vertex = CGAL::Surface_mesh<Kernel::Point_3>::Vertex_index;
  for (const auto& [a, b, c] : mesh.triangles) surface.add_face(Vertex(a), Vertex(b), Vertex(c));
  return CGAL::Polygon_mesh_processing::does_self_intersect(surface);
}

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
