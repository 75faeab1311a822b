// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "collision/half_space_contacts.hpp"
#include "collision/scene.hpp"
#include "core/contact.hpp"
#include "core/frame.hpp"
#include "core/least_distance.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The plane that keeps the tool and one convex obstacle apart, and what it is fixed to: the obstacle (any
/// normal that stands still in the world), a face of the tool, or an edge of each.
struct SeparatingPlane {
  ContactKind kind = ContactKind::vertex_face;
  Vector3d n_W = Vector3d::UnitZ();  ///< from the obstacle to the tool; of the pose where it was taken
  Vector3d d_T = Vector3d::Zero();   ///< as in Contact
  Vector3d d_W = Vector3d::Zero();   ///< as in Contact
};

/// The contacts of a scene, for one user.
///
/// Two convex bodies are apart where some plane separates them. For one plane that is a set of gaps which all
/// must be open, as the projection wants them; but any plane will do. So each obstacle holds a plane, the
/// projection solves for the planes held, and the planes are changed until no other choice is better. Every
/// pose that the planes held admit is admissible, whichever they are.
///
/// Memory is taken at construction. One object serves one thread.
class SceneContacts final : public ContactSource {
 public:
  /// The scene is kept by reference.
  explicit SceneContacts(const Scene& scene);

  /// The deepest vertices of the tool in each half-space, at most kMaxPerObstacle of each, and the pairs that
  /// lie deepest beyond the planes held.
  std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                           ContactSet& contacts) const noexcept override;

  void add_touching(const Pose& X_WT, double within_m, ContactSet& contacts) const noexcept override;

  bool admits(const Pose& X_WT, double tolerance_m) const noexcept override;

  /// Sees to it that the planes held admit a pose that overlaps nothing: takes the widest apart where they do
  /// not. RT safe.
  void select_admitting_planes(const Pose& X_WT, double tolerance_m) noexcept;

  /// Looks at every plane worth a try from this pose: all faces, and all pairs of edges where there are not
  /// too many. Holds for each convex obstacle the one that separates best, or least badly. Returns how many
  /// there are to open(). RT safe, but dear.
  std::size_t survey_planes(const Pose& X_WT) noexcept;
  /// Holds the planes of the last survey, with its i-th, the least deep first, in the place of one of them.
  void hold_survey_plane(std::size_t i) noexcept;

  /// Lets the planes held stand still in the world, as they stand at this pose. RT safe.
  void fix_planes_to_world(const Pose& X_WT) noexcept;

  /// Collects the planes other than those held that admit this pose, the widest apart first, among the
  /// features that touch the planes held. Returns how many. RT safe.
  std::size_t find_alternative_planes(const Pose& X_WT) noexcept;

  /// Holds the i-th of them.
  void hold_alternative(std::size_t i) noexcept { planes_[candidates_[i].obstacle] = candidates_[i].plane; }

  const std::vector<SeparatingPlane>& planes() const noexcept { return planes_; }
  /// planes: of this scene. RT safe.
  void set_planes(const std::vector<SeparatingPlane>& planes) noexcept { planes_ = planes; }

  /// Do the planes held press where both bodies are? Then no other plane does better: the forces that keep
  /// the tool at q also balance on the plane. RT safe.
  bool planes_optimal(const Projection& q) noexcept;

 private:
  struct PlaneCandidate {
    std::uint32_t obstacle;  ///< among the convex ones
    SeparatingPlane plane;
    double separation_m;
  };
  /// Vertices of both bodies.
  struct VertexPair {
    std::uint32_t tool_vertex = 0;
    std::uint32_t obstacle_vertex = 0;
  };
  /// Where the contacts with one obstacle press.
  struct PressureCentre {
    Vector3d centre_W_m = Vector3d::Zero();
    VertexPair pair;   ///< one of them
    int contacts = 0;  ///< how many carry
  };
  /// Of a plane at one pose.
  struct PlaneNormal {
    Vector3d n_W;
    bool degenerate;  ///< parallel edges: no common normal
  };
  /// A plane at one pose.
  struct PlaneSeparation {
    Vector3d n_W;
    VertexPair nearest;
    double separation_m;
    bool degenerate;  ///< as in Normal
  };

  static constexpr std::size_t kMaxCandidates = 96;     ///< for one obstacle
  static constexpr std::size_t kMaxSurveyPlanes = 288;  ///< for all
  static constexpr std::size_t kMaxEdgePairs = 200000;  ///< compared at once by survey(): some milliseconds

  void add_convex(std::uint32_t k, const Frame& X_WT, double tolerance_m, std::size_t most,
                  ContactSet& contacts) const noexcept;
  static PlaneNormal normal_of(const SeparatingPlane& plane, const Frame& X_WT) noexcept;
  bool spheres_separated(std::uint32_t k, const Vector3d& n_W, const Frame& X_WT) const noexcept;
  PlaneSeparation plane_separation(std::uint32_t k, const PlaneNormal& normal,
                                   const Frame& X_WT) const noexcept;
  double separation_m(std::uint32_t k, const Vector3d& n_W, VertexPair pair,
                      const Frame& X_WT) const noexcept;
  bool separates(std::uint32_t k, const Frame& X_WT, double tolerance_m) const noexcept;
  bool out_of_reach(std::uint32_t k, const Frame& X_WT) const noexcept;
  std::optional<PressureCentre> pressure_of(std::uint32_t k, const Projection& q) const noexcept;
  bool plane_optimal(std::uint32_t k, const Projection& q) noexcept;
  bool contains(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
                const Vector3d& p_m) noexcept;
  void add_candidate(std::uint32_t k, SeparatingPlane plane, const Frame& X_WT,
                     double least_separation_m) noexcept;
  void add_centre_line_candidate(std::uint32_t k, const Frame& X_WT) noexcept;
  void add_face_candidates(std::uint32_t k, const Frame& X_WT) noexcept;
  void add_edge_pair_candidates(std::uint32_t k, const Frame& X_WT) noexcept;
  void add_edge_pair_candidate(std::uint32_t k, const Frame& X_WT, const ConvexBody::Edge& a,
                               const ConvexBody::Edge& b, double least_separation_m) noexcept;
  void collect_touching(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
                        std::vector<std::uint32_t>& out) const noexcept;
  void add_touching_candidates(std::uint32_t k, const PlaneSeparation& held, const Frame& X_WT) noexcept;
  void add_widest_gap_candidate(std::uint32_t k, const Frame& X_WT) noexcept;
  void sort_candidates() noexcept;

  const Scene& scene_;
  HalfSpaceContacts half_spaces_;
  std::vector<SeparatingPlane> planes_;       ///< one for each convex obstacle
  std::vector<SeparatingPlane> survey_best_;  ///< of the last survey
  std::vector<PlaneCandidate> candidates_;
  std::vector<PlaneCandidate> survey_candidates_;
  mutable std::vector<VertexPair> last_nearest_;  ///< what was found nearest last: where to look first
  LeastDistance<3, 64> widest_gap_;
  std::vector<std::uint32_t> touching_vertices_;  ///< vertices, of the tool where both bodies are looked at
  std::vector<std::uint32_t> obstacle_touching_vertices_;
};

}  // namespace wrenchd
