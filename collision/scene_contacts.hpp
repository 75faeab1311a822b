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

/// A plane between the tool and one convex obstacle. It is fixed to the obstacle (its normal is constant in
/// the world), to a face of the tool, or to an edge of each.
struct SeparatingPlane {
  ContactKind kind = ContactKind::vertex_face;
  /// normal from the obstacle to the tool, at the pose where the plane was selected
  Vector3d n_W = Vector3d::UnitZ();
  Vector3d d_T = Vector3d::Zero();  ///< normal or edge direction in T; same meaning as Contact::d_T
  Vector3d d_W = Vector3d::Zero();  ///< edge direction in W; same meaning as Contact::d_W
};

/// The contacts of a scene with half-spaces and convex obstacles.
///
/// Two convex bodies are apart if and only if a plane separates them. For one plane this yields a set of gaps
/// that must all be open. For each obstacle this object holds one plane. The projection solves for the held
/// planes, and the caller exchanges planes until no other choice is better. Every pose that the held planes
/// admit is admissible (core/METHOD.md, section 3.7).
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe unless stated otherwise.
class SceneContacts final : public ContactSource {
 public:
  /// Keeps a reference to the scene, which must outlive this object. Not RT-safe: allocates.
  explicit SceneContacts(const Scene& scene);

  /// Adds the deepest vertices of the tool in each half-space, at most kMaxPerObstacle of each, and the
  /// deepest vertex pairs of each held plane. RT-safe.
  std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                           ContactSet& contacts) const noexcept override;

  void add_touching(const Pose& X_WT, double within_m, ContactSet& contacts) const noexcept override;

  bool admits(const Pose& X_WT, double tolerance_m) const noexcept override;

  /// Replaces the planes that do not admit X_WT by the planes of widest separation. Precondition: the pose
  /// overlaps nothing. RT-safe.
  void select_admitting_planes(const Pose& X_WT, double tolerance_m) noexcept;

  /// Tests all candidate planes at X_WT: all faces, and all edge pairs up to kMaxEdgePairs. Holds for each
  /// convex obstacle the plane of largest separation. Returns the number of alternatives for
  /// hold_survey_plane(). Not RT-safe: allocates nothing, but may take several milliseconds.
  std::size_t survey_planes(const Pose& X_WT) noexcept;
  static constexpr std::size_t kMaxSurveyPlanes = 288;  ///< for all obstacles
  /// Holds the planes of the last survey, and replaces one of them by the survey's alternative i.
  /// Alternatives are sorted by survey_estimate(), the least first. RT-safe.
  void hold_survey_plane(std::size_t i) noexcept;
  /// Returns about the least T from the surveyed pose that opens the plane of alternative i [kg m^2]: the one
  /// that moves the deepest vertex of the tool out of it by a small rotation and a translation. RT-safe.
  double survey_estimate(std::size_t i) const noexcept { return survey_candidates_[i].estimate; }

  /// Fixes the held planes in the world as they are at X_WT. RT-safe.
  void fix_planes_to_world(const Pose& X_WT) noexcept;

  /// Collects other planes that admit X_WT from the features that touch the held planes, the widest
  /// separation first. Returns their number. RT-safe.
  std::size_t find_alternative_planes(const Pose& X_WT) noexcept;

  /// Holds alternative i of find_alternative_planes(). RT-safe.
  void hold_alternative(std::size_t i) noexcept { planes_[candidates_[i].obstacle] = candidates_[i].plane; }

  const std::vector<SeparatingPlane>& planes() const noexcept { return planes_; }
  /// Holds `planes`, one for each convex obstacle of this scene. RT-safe.
  void set_planes(const std::vector<SeparatingPlane>& planes) noexcept { planes_ = planes; }

  /// Returns true if the centre of pressure of every held plane lies in both bodies: METHOD (30). Then no
  /// other plane yields a better answer. RT-safe.
  bool planes_optimal(const Projection& q) noexcept;

 private:
  /// A vertex of the tool and a vertex of the obstacle.
  struct VertexPair {
    std::uint32_t tool_vertex = 0;
    std::uint32_t obstacle_vertex = 0;
  };
  struct PlaneCandidate {
    std::uint32_t obstacle;  ///< index among the convex obstacles
    SeparatingPlane plane;
    double separation_m;
    VertexPair nearest;
    double estimate = 0.0;  ///< see survey_estimate(); only after survey_planes() [kg m^2]
  };
  /// The centre of pressure of the contacts with one obstacle.
  struct PressureCentre {
    Vector3d centre_W_m = Vector3d::Zero();
    VertexPair pair;   ///< vertices of one of the contacts
    int contacts = 0;  ///< number of loaded contacts
  };
  /// The normal of a plane at one pose.
  struct PlaneNormal {
    Vector3d n_W;
    bool degenerate;  ///< true if the edges are parallel and have no common normal
  };
  /// The separation of two bodies along a plane's normal at one pose.
  struct PlaneSeparation {
    Vector3d n_W;
    VertexPair nearest;
    double separation_m;
    bool degenerate;  ///< same meaning as PlaneNormal::degenerate
  };

  static constexpr std::size_t kMaxCandidates = 96;  ///< for one obstacle
  /// survey_planes() compares no more; this many take some milliseconds
  static constexpr std::size_t kMaxEdgePairs = 200000;

  void add_convex(std::uint32_t k, const Frame& X_WT, double tolerance_m, std::size_t max_contacts,
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
  void estimate_survey(const Frame& X_WT) noexcept;

  const Scene& scene_;
  HalfSpaceContacts half_spaces_;
  std::vector<SeparatingPlane> planes_;       ///< one for each convex obstacle
  std::vector<SeparatingPlane> survey_best_;  ///< held planes at the end of the last survey
  std::vector<PlaneCandidate> candidates_;
  std::vector<PlaneCandidate> survey_candidates_;
  /// nearest vertices of the last query, start of the next support search
  mutable std::vector<VertexPair> last_nearest_;
  LeastDistance<3, 64> widest_gap_;
  std::vector<std::uint32_t> touching_vertices_;  ///< vertices of the tool, if both bodies are searched
  std::vector<std::uint32_t> obstacle_touching_vertices_;
};

}  // namespace wrenchd
