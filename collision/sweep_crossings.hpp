// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "collision/scene.hpp"
#include "collision/sweep_query.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"

// What every sweep query shares: the tolerances that define a crossing, the closing times, the contacts of
// crossed features, and the choice of the first crossings. core/METHOD.md, section 14.3.

namespace wrenchd {

namespace sweep_tolerance {

/// Tolerance beyond the border of a face or an edge, as a multiple of the clearance: far above rounding, far
/// below the distance of neighbours.
constexpr double kBorder = 0.01;
/// A gap is closed if it exceeds the clearance by at most this, and a touching feature may lie this far
/// beyond its border, both as multiples of the clearance.
constexpr double kClosing = 0.1;
constexpr double kTouch = 1.0;
/// A gap at the start may be this far below zero, as a multiple of the clearance.
constexpr double kStart = 0.5;
/// Slope by which the features around a contact may seem to be nearer than the contact, because the straight
/// path approximates the true one.
constexpr double kSlope = 1e-3;
/// If the end pose overlaps but no crossing was found, crossings missed a feature's border narrowly. The
/// sweep then repeats the feature tests with this tolerance, as a fraction of the path, and ignores slopes.
/// It does so on paths of at most this length, as a fraction of the tool's radius: on a longer path the
/// tolerance would reach features that the tool passes, for example the face beside a narrow hole. The caller
/// shortens longer paths.
constexpr double kWideBorder = 0.05;
constexpr double kWideBorderPath = 1e-4;
constexpr double kAnySlope = 2.0;
/// Up to this rotation [rad] arc and chord differ by less than 1e-5 of the tool's size.
constexpr double kNegligibleRotation_rad = 5e-3;
/// Two edges may overlap on the path by this depth, as a fraction of the path, and separate again on the side
/// from which they came. Such a dip of second order, METHOD (95), passes nothing. A deeper one makes the path
/// too long.
constexpr double kDip = 1e-3;
/// Sine of the angle below which two edges have no usable normal.
constexpr double kParallel = 1e-7;

}  // namespace sweep_tolerance

/// Returns the point at fraction s of the straight path from a to b. RT-safe.
inline Vector3d interpolate(const Vector3d& a, const Vector3d& b, double s) noexcept {
  return a + s * (b - a);
}

/// Returns the path fraction at which a gap has decreased to the clearance: METHOD (94). RT-safe.
inline double closing_time(double start_m, double end_m, double clearance_m) noexcept {
  return std::clamp((start_m - clearance_m) / (start_m - end_m), 0.0, 1.0);
}

/// Returns the first t at which a (1 - t)^2 + 2 b t (1 - t) + c t^2 changes from positive to negative; 2 if
/// there is none. RT-safe.
inline double first_fall_through_zero(double a, double b, double c) noexcept {
  const double root2 = b * b - a * c;
  if (root2 < 0.0) return 2.0;
  const double root = std::sqrt(root2), fall = a - b;
  const double t = fall > 0.0 ? a / (fall + root) : (fall - root) / (fall + c - b);
  return std::isfinite(t) ? t : 2.0;
}

/// One obstacle and the tool's path in the frame O of the obstacle's mesh.
struct ObstacleView {
  const MeshObstacle* obstacle;
  std::uint32_t number;  ///< number of the obstacle in the scene
  Frame X_WO;            ///< pose of the obstacle at the end of the path
  Frame X_OT_start, X_OT_end;
  unsigned sides = MeshSurface::kFront;  ///< sides of the obstacle's mesh on which the tool can be
};

/// The contact of a vertex of the tool and a face of the obstacle. plane: plane of the face in O, with the
/// normal towards the vertex. RT-safe.
Contact vertex_face_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t vertex,
                            std::uint32_t triangle, const MeshSurface::Plane& plane) noexcept;

/// The contact of a face of the tool and a vertex of the obstacle. plane: plane of the face in T, with the
/// normal towards the vertex. RT-safe.
Contact face_vertex_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t triangle,
                            const MeshSurface::Plane& plane, std::uint32_t vertex) noexcept;

/// The contact of two edges. sign: +1 or -1, so that sign (d_A x d_B) leaves the obstacle. n_O: unit normal
/// at the end of the path, in O. RT-safe.
Contact edge_edge_contact(const ObstacleView& view, const MeshSurface& tool, std::uint32_t edge_a,
                          std::uint32_t edge_b, double sign, const Vector3d& n_O) noexcept;

/// A direction out of the obstacle at both ends of the path, in O. Not of unit length. The normal of a
/// contact of two edges has a positive component along it.
struct OutwardPath {
  Vector3d start, end;
};

/// Returns the direction for an edge of the obstacle and an edge of the tool. Between two faces the direction
/// is the middle of the sector from which the edge is convex. At a border the normal may lie on either side
/// of the face, so the edge of the tool decides. If both edges are borders, the result is from_b_at_start.
/// That vector points from the obstacle's edge to the tool's at the start of the path. RT-safe.
OutwardPath outward_path(const MeshSurface& obstacle, const MeshSurface::Edge& edge_b,
                         const MeshSurface& tool, const MeshSurface::Edge& edge_a, const ObstacleView& view,
                         const Vector3d& from_b_at_start) noexcept;

/// A pair of features that the path crosses.
struct Crossing {
  double path_fraction;  ///< position on the path: 0 at the start, 1 at the end
  Vector3d point_W_m;
  Contact contact;
};

/// The crossings of one sweep. The constructor allocates all memory. All other members are RT-safe.
class CrossingList {
 public:
  CrossingList();
  CrossingList(const CrossingList&) = delete;  // a copy would lose the reserved memory
  CrossingList& operator=(const CrossingList&) = delete;

  void clear() noexcept { crossings_.clear(); }
  bool empty() const noexcept { return crossings_.empty(); }
  std::size_t size() const noexcept { return crossings_.size(); }

  /// If there is no room left, an earlier crossing replaces the latest one.
  void add(double path_fraction, const Vector3d& point_W_m, const Contact& contact) noexcept;

  /// Sorts the crossings along the path, and those at one place by their features, so that the order does
  /// not depend on the order in which they were found. Then copies them to `contacts`, the first of several
  /// close together.
  /// displacement_bound_m: length of the path.
  void select_first(double displacement_bound_m, double tool_radius_m,
                    StaticVector<Contact, SweepQuery::kMaxContacts>& contacts) noexcept;

 private:
  std::vector<Crossing> crossings_;
};

}  // namespace wrenchd
