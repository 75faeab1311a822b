// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "collision/cgal/cgal_mesh_tree.hpp"
#include "collision/cgal/exact_decisions.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "collision/scene.hpp"
#include "collision/sweep_crossings.hpp"
#include "collision/sweep_query.hpp"

namespace wrenchd {

/// Sweep queries on CGAL's AABB trees with exact decisions. They find the contacts that MeshContacts finds,
/// and share with it only the definition of a contact (sweep_crossings.hpp). So each checks the other.
///
/// Each sweep searches the trees anew: it keeps no candidate lists and needs no prefetch, and no work limit
/// applies. Not RT-safe: a sweep allocates, and takes 0.1 to 100 ms, depending on the meshes
/// (collision/README.md, "CGAL as backend"). One object serves one thread.
class CgalContacts final : public SweepQuery {
 public:
  /// Keeps a reference to the scene, which must outlive this object.
  explicit CgalContacts(const Scene& scene);

  void set_start(const Pose& X_WT, double time_s = 0.0) noexcept override;
  /// Ends the program if no memory is left.
  SweepResult sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget,
                    double time_s = 0.0) noexcept override;
  void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                std::uint32_t spare_visits = 0) noexcept override;
  double covered_fraction(const Pose&) const noexcept override { return 1.0; }
  double list_visits_per_tick() const noexcept override { return 0.0; }
  std::uint32_t sweep_visits() const noexcept override { return 0; }
  void reset() noexcept override {}
  const ContactSet& touching() const noexcept override { return touching_; }
  std::size_t candidate_count() const noexcept override { return candidate_count_; }

 private:
  /// An obstacle that the tool may meet on the path.
  struct NearObstacle {
    ObstacleView view;
    const CgalMeshTree* tree;
  };
  /// A triangle of the tool in the obstacle's frame, at both ends of the path.
  struct MovedTriangle {
    std::uint32_t triangle;
    Triangle start, end;
    MeshSurface::Plane plane_start, plane_end;
  };
  /// Where a vertex passes a face, in the frame of the face's body.
  struct VertexPass {
    MeshSurface::Plane plane;  ///< plane of the face, with the normal towards the vertex
    bool closes;               ///< the gap closes on the path; otherwise it touches at the end
    double path_fraction;      ///< where the gap closes, or the end of the path
    Vector3d p_m;              ///< position of the vertex there
  };
  /// An edge of the tool that moves past an edge of the obstacle, in the obstacle's frame.
  struct EdgePass {
    const ObstacleView& view;
    std::uint32_t edge_a, edge_b;
    exact::EdgePair start, end;
    double sign;
  };

  void find_near_obstacles(const Pose& X_WT, double time_s);
  double displacement_bound_m(const Pose& from, const Pose& to) const;
  void test_all_pairs(SweepResult& result);
  bool end_pose_overlaps() const;
  MovedTriangle moved_triangle(const ObstacleView& view, std::uint32_t triangle) const;
  bool plane_separates(const MeshSurface::Plane& plane_start, const MeshSurface::Plane& plane_end,
                       const Triangle& start, const Triangle& end, double min_gap_m) const;
  void test_pair(const ObstacleView& view, const MovedTriangle& a, std::uint32_t b, SweepResult& result);
  template <class AtStart, class AtEnd>
  std::optional<VertexPass> vertex_pass(const MeshSurface& face_body, std::uint32_t triangle,
                                        const MeshSurface& vertex_body, std::uint32_t vertex,
                                        const AtStart& at_start, const AtEnd& at_end) const;
  template <class AtStart, class AtEnd>
  std::optional<VertexPass> vertex_pass_on_side(const MeshSurface::Plane& side, const MeshSurface& face_body,
                                                std::uint32_t triangle, const MeshSurface& vertex_body,
                                                std::uint32_t vertex, const AtStart& at_start,
                                                const AtEnd& at_end) const;
  void test_edges(const ObstacleView& view, const MovedTriangle& a, std::uint32_t edge_a,
                  std::uint32_t edge_b, SweepResult& result);
  bool passes_parallel(const EdgePass& pass, const double (&f)[3], double parallel_fraction) const;
  bool edges_touch(const EdgePass& pass, double sign, double fraction, double tolerance_m,
                   Vector3d* point_O_m = nullptr) const;
  void add_contact(bool closes, double path_fraction, const Vector3d& point_W_m, const Contact& contact);

  const Scene& scene_;
  std::shared_ptr<const CgalMeshTree> tool_tree_;
  std::vector<std::shared_ptr<const CgalMeshTree>> trees_;  ///< one for each of scene.meshes()

  Pose X_start_;
  double start_time_s_ = 0.0;
  std::vector<NearObstacle> near_;
  double clearance_m_ = 0.0;
  double displacement_bound_m_ = 0.0;  ///< largest displacement of a tool point over all obstacle frames [m]
  double rotation_rad_ = 0.0;          ///< largest rotation of the tool over all obstacle frames [rad]
  double arc_deviation_m_ = 0.0;       ///< METHOD (95a)
  double feature_margin_m_ = 0.0;      ///< tolerance beyond the border of a feature at a crossing [m]
  double slope_tolerance_ = 0.0;       ///< slope by which neighbouring features may seem to be nearer

  std::vector<CgalMeshTree::Pair> pairs_;
  std::size_t candidate_count_ = 0;
  CrossingList crossings_;
  ContactSet touching_;
  bool overlap_found_ = false;  ///< a sweep of this tick found an overlap at its end pose
};

}  // namespace wrenchd
