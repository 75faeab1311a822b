// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/predictive_candidate_list.hpp"
#include "collision/pairs/separating_axes.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "collision/scene.hpp"
#include "collision/sweep_crossings.hpp"
#include "collision/sweep_query.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Sweep queries on wrenchd's own BVH and kernels. collision/README.md ("The sweep") describes the design.
///
/// A predictive candidate list (pairs/predictive_candidate_list.hpp) supplies the pairs of triangles near the
/// path. The constructor allocates all memory. One object serves one thread. All members but the constructor
/// are RT-safe.
class MeshContacts final : public SweepQuery {
 public:
  /// Keeps a reference to the scene, which must outlive this object. motion_is_continuous: as in
  /// PredictiveCandidateList. Not RT-safe: allocates.
  explicit MeshContacts(const Scene& scene, bool motion_is_continuous = true);

  /// Sets the start of the next sweeps: a pose that is admissible at scene time time_s [s]. RT-safe.
  void set_start(const Pose& X_WT, double time_s = 0.0) noexcept override;

  /// Sweeps the path from the start to X_WT while the obstacles move to their poses at time_s [s]. Contacts
  /// are held open by clearance_m [m]. The result states the contacts for the obstacle poses at time_s.
  /// Reduces `budget` by the work done. RT-safe.
  SweepResult sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget,
                    double time_s = 0.0) noexcept override;

  /// Prefetches candidate pairs for the predicted path. Call it once per tick with the tool pose X_WT and the
  /// commanded pose X_WP. spare_visits: node visits that the prefetch may use even if it does not need them
  /// yet. RT-safe.
  void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                std::uint32_t spare_visits = 0) noexcept override;

  /// Returns the fraction [0, 1] of the path from the start to X_WT that the current candidate list covers.
  /// Precondition: no obstacle moves. RT-safe.
  double covered_fraction(const Pose& X_WT) const noexcept override {
    return candidates_.covered_fraction(X_start_, X_WT);
  }
  /// Returns the cost of a candidate list per tick in which it is used [node visits]. RT-safe.
  double list_visits_per_tick() const noexcept override { return candidates_.list_visits_per_tick(); }

  /// Returns the work of this tick's sweeps without candidate lists [node visits]. RT-safe.
  std::uint32_t sweep_visits() const noexcept override { return sweep_visits_; }

  /// Discards predictions and candidate lists, for example after the tool was placed elsewhere. RT-safe.
  void reset() noexcept override { candidates_.reset(); }

  /// The contacts whose gap at the end pose of the last sweep is at most the clearance, plus rounding.
  const ContactSet& touching() const noexcept override { return touching_; }

  std::size_t candidate_count() const noexcept override { return candidates_.current().pairs().size(); }

 private:
  /// A triangle of the tool in the obstacle's frame, at both ends of the path.
  struct MovedTriangle {
    std::uint32_t triangle = MeshSurface::kNone;
    std::uint32_t obstacle = MeshSurface::kNone;
    Triangle start, end;
    MeshSurface::Plane plane_start, plane_end;
  };
  using Heights = std::array<double, 3>;  ///< heights of a triangle's corners above a plane [m]

  /// The motion of a vertex past a face, in the frame of the face's body.
  struct VertexPass {
    MeshSurface::Plane plane;    ///< plane of the face, with the normal towards the vertex
    bool closes = false;         ///< the gap closes on the path; otherwise it touches at the end
    double path_fraction = 1.0;  ///< where the gap closes, or the end of the path
    Vector3d p;                  ///< position of the vertex there [m]
  };

  /// The motion of an edge of the tool (a) relative to an edge of the obstacle (b), in the obstacle's frame.
  struct EdgePairMotion {
    std::uint32_t edge_a, edge_b;
    Vector3d a0_start, a0_end, da_start, da_end, b0, db;
    Vector3d p;   ///< point where the edges touch [m]
    double sign;  ///< +1 or -1: orients the cross product of da and db out of the obstacle
  };

  void continue_from(const Pose& X_WT, double time_s) noexcept;
  void update_obstacle_views(const Pose& X_WT, double time_s) noexcept;
  void test_pairs(VisitBudget& budget, SweepResult& result) noexcept;
  bool plane_separates(const Heights& start_m, const Heights& end_m, double min_gap_m) const noexcept;
  const MovedTriangle& moved_triangle(const CandidatePair& pair) noexcept;
  bool closes(double start_m, double end_m) const noexcept;
  void test_pair(const CandidatePair& pair, const MovedTriangle& a, SweepResult& result) noexcept;
  template <class AtStart, class AtEnd>
  std::optional<VertexPass> vertex_pass(const MeshSurface& face_body, unsigned sides, std::uint32_t triangle,
                                        const MeshSurface& vertex_body, std::uint32_t vertex,
                                        const AtStart& at_start, const AtEnd& at_end) const noexcept;
  template <class AtStart, class AtEnd>
  std::optional<VertexPass> vertex_pass_on_side(const MeshSurface::Plane& side, unsigned sides,
                                                const MeshSurface& face_body, std::uint32_t triangle,
                                                const MeshSurface& vertex_body, std::uint32_t vertex,
                                                const AtStart& at_start, const AtEnd& at_end) const noexcept;
  void vertices_on_face(const ObstacleView& view, const CandidatePair& pair) noexcept;
  void face_on_vertices(const ObstacleView& view, const CandidatePair& pair) noexcept;
  void edges_on_edges(const ObstacleView& view, const CandidatePair& pair, const MovedTriangle& a,
                      SweepResult& result) noexcept;
  void edge_on_edge(const ObstacleView& view, const MovedTriangle& a, std::uint32_t edge_a,
                    std::uint32_t edge_b, SweepResult& result) noexcept;
  bool edges_touch(const ObstacleView& view, EdgePairMotion& pass, double fraction,
                   double tolerance_m) const noexcept;
  void add_contact(bool closes, double path_fraction, const Vector3d& point_W_m,
                   const Contact& contact) noexcept;
  void verify_end_pose(VisitBudget& budget, SweepResult& result) noexcept;

  const Scene& scene_;
  PredictiveCandidateList candidates_;

  Pose X_start_;
  double start_time_s_ = 0.0;
  Pose X_free_end_;  ///< end of the last path on which the tool met nothing
  double free_end_time_s_ = 0.0;
  unsigned tool_sides_ = MeshSurface::kFront;  ///< sides of the tool's mesh on which an obstacle can be
  std::vector<ObstacleView> obstacle_views_;   ///< one entry for each mesh obstacle of the scene
  double clearance_m_ = 0.0;
  /// largest displacement of any tool point over all obstacle frames [m]
  double displacement_bound_m_ = 0.0;
  double rotation_rad_ = 0.0;      ///< largest rotation of the tool over all obstacle frames [rad]
  double arc_deviation_m_ = 0.0;   ///< largest deviation of a point's arc from its chord [m]
  double feature_margin_m_ = 0.0;  ///< tolerance beyond the border of a feature at a crossing [m]
  double slope_tolerance_ = 0.0;   ///< slope by which neighbouring features may seem to be nearer

  std::vector<std::uint32_t> remaining_pairs_;  ///< indices of the candidate pairs that the culler keeps
  SeparatingAxes separating_axes_;
  MovedTriangle moved_triangle_;
  std::uint32_t tested_pairs_ = 0;  ///< number of pairs that reached the feature tests
  CrossingList crossings_;
  BvhTraversal traversal_;  ///< for verify_end_pose() only
  std::uint32_t sweep_visits_ = 0;
  bool overlap_found_ = false;  ///< a sweep of this tick reported an overlap
  ContactSet touching_;
};

}  // namespace wrenchd
