// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/predictive_candidate_list.hpp"
#include "collision/pairs/separating_axes.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "collision/scene.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// What the tool's surface meets on the straight way from one pose to another.
///
/// Two surfaces that are apart at the start and move straight meet first in a vertex and a face or in two
/// edges (mesh_surface.hpp). So it is enough to look at those pairs of features: a pair has been *crossed*
/// where its gap is open at the start, is not at the end, and the features, and not only the plane or the
/// lines that carry them, are opposite each other when it closes. Of pairs that are crossed close together
/// only the first counts: once it is held open the others may never be reached.
///
/// Nothing that turns moves straight. A way is taken to be straight in the obstacle's frame for the vertices
/// of the tool, in the tool's frame for those of the obstacle, which is the same but for what a chord leaves
/// out of an arc. Where that is more than a trifle, the end of a way on which nothing was met is looked at
/// once more: do any two triangles meet there, whatever their features?
///
/// Which pairs of triangles are near the way, lists tell that are made ahead (pairs_ahead.hpp).
///
/// Memory is taken at construction. One object serves one thread.
class MeshContacts {
 public:
  static constexpr std::size_t kMaxContacts = 12;

  struct SweepResult {
    /// The contacts met, the first on the way first; not all, but never none where there is one.
    StaticVector<Contact, kMaxContacts> contacts;
    bool overlaps = false;  ///< the end pose overlaps, though nothing was seen on the way: it is too long.
                            ///< Not told of all that do, but of all that are turned far on the way.
    bool complete = true;   ///< false: the way is too long for what may be looked at; nothing is known
    bool list_pending = false;  ///< then: but not for long, what is needed to look at it is being made
  };

  /// The scene is kept by reference.
  explicit MeshContacts(const Scene& scene);
  MeshContacts(const MeshContacts&) = delete;  // a copy would lose the room that is kept
  MeshContacts& operator=(const MeshContacts&) = delete;

  /// Starts from a pose that is admissible at a scene time. RT safe.
  void set_start(const Pose& X_WT, double time_s = 0.0) noexcept;

  /// The way from the start to X_WT, whose contacts are held open by clearance_m, while the obstacles move to
  /// where they stand at time_s. The contacts are told as they stand then. RT safe.
  SweepResult sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget, double time_s = 0.0) noexcept;

  /// Once a tick, when the tool has come to X_WT, following a hand that has come to X_WP: prepares for where
  /// it will be. to_spare: visits that may as well be spent on that, if it does not need as many. RT safe.
  void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                std::uint32_t to_spare = 0) noexcept;

  /// The share of the way from the start to X_WT that can be looked at now, in a scene where nothing moves.
  /// RT safe.
  double covered_fraction(const Pose& X_WT) const noexcept {
    return candidates_.covered_fraction(X_start_, X_WT);
  }
  /// What it takes to list pairs, for every tick that a list serves; in visits.
  double list_visits_per_tick() const noexcept { return candidates_.list_visits_per_tick(); }

  /// What the looks of this tick took beside the lists, in visits.
  std::uint32_t sweep_visits() const noexcept { return sweep_visits_; }

  /// The tool is elsewhere now. RT safe.
  void reset() noexcept { candidates_.reset(); }

  /// The contacts that touch at the end looked at last, with their gap no wider than the clearance, and
  /// rounding.
  const ContactSet& touching() const noexcept { return touching_; }

  std::size_t candidate_count() const noexcept { return candidates_.current().pairs().size(); }  ///< listed

 private:
  struct Crossing {
    double path_fraction;  ///< 0 at the start, 1 at the end
    Vector3d point_W_m;
    Contact contact;
  };
  /// One obstacle, seen along the way.
  struct ObstacleView {
    const MeshObstacle* obstacle;
    std::uint32_t number;  ///< in the scene
    Frame X_WO;            ///< at the end
    Frame X_OT_start, X_OT_end;
  };
  /// A triangle of the tool as an obstacle sees it, at both ends.
  struct MovedTriangle {
    std::uint32_t triangle = MeshSurface::kNone;
    std::uint32_t obstacle = MeshSurface::kNone;
    Triangle start, end;
    MeshSurface::Plane plane_start, plane_end;
  };
  using Heights = std::array<double, 3>;  ///< of a triangle's corners over a plane [m]

  /// Two edges on the way; in the obstacle's frame.
  struct EdgePairMotion {
    std::uint32_t edge_a, edge_b;
    Vector3d a0_start, a0_end, da_start, da_end, b0, db;
    Vector3d p;   ///< where they meet
    double sign;  ///< of the cross product of da and db that points out of the obstacle
  };

  void update_obstacle_views(const Pose& X_WT, double time_s) noexcept;
  void test_pairs(VisitBudget& budget, SweepResult& findings) noexcept;
  bool plane_separates(const Heights& start_m, const Heights& end_m, double least_m) const noexcept;
  const MovedTriangle& moved_triangle(const CandidatePair& pair) noexcept;
  bool closes(double start_m, double end_m) const noexcept;
  void test_pair(const CandidatePair& pair, const MovedTriangle& a, SweepResult& findings) noexcept;
  void vertices_on_face(const ObstacleView& seen, const CandidatePair& pair, const MovedTriangle& a) noexcept;
  void face_on_vertices(const ObstacleView& seen, const CandidatePair& pair) noexcept;
  void edges_on_edges(const ObstacleView& seen, const CandidatePair& pair, const MovedTriangle& a,
                      SweepResult& findings) noexcept;
  void edge_on_edge(const ObstacleView& seen, const MovedTriangle& a, std::uint32_t edge_a,
                    std::uint32_t edge_b, SweepResult& findings) noexcept;
  bool edges_touch(const ObstacleView& seen, EdgePairMotion& pass, double when,
                   double beyond_m) const noexcept;
  void add_crossing(double when, const Vector3d& point_W_m, const Contact& contact) noexcept;
  void select_first_contacts(SweepResult& findings) noexcept;
  void verify_end_pose(VisitBudget& budget, SweepResult& findings) noexcept;

  const Scene& scene_;
  PredictiveCandidateList candidates_;

  Pose X_start_;
  double start_time_s_ = 0.0;
  std::vector<ObstacleView> obstacle_views_;  ///< all obstacles
  double clearance_m_ = 0.0;
  double displacement_bound_m_ = 0.0;  ///< the longest that an obstacle sees a point of the tool go
  double rotation_rad_ = 0.0;          ///< likewise, how far it turns
  double arc_deviation_m_ = 0.0;       ///< by how much a way may leave the straight line as it turns
  double feature_margin_m_ = 0.0;      ///< by how much features may miss each other as they cross
  double slope_tolerance_ = 0.0;       ///< by which their surroundings may seem to come first

  std::vector<std::uint32_t> remaining_pairs_;  ///< of the pairs listed: those that may meet on the way
  SeparatingAxes separating_axes_;
  MovedTriangle moved_triangle_;
  std::uint32_t tested_pairs_ = 0;  ///< pairs that no plane keeps apart
  std::vector<Crossing> crossings_;
  BvhTraversal traversal_;  ///< of verify_end_pose()
  std::uint32_t sweep_visits_ = 0;
  bool overlap_found_ = false;  ///< it told of an overlap in this tick
  ContactSet touching_;
};

}  // namespace wrenchd
