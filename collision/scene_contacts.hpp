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
struct HeldPlane {
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

  /// The deepest vertices of the tool in each half-space, at most kPerObstacle of each, and the pairs that
  /// lie deepest beyond the planes held.
  std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                           ContactSet& contacts) const noexcept override;

  void add_touching(const Pose& X_WT, double within_m, ContactSet& contacts) const noexcept override;

  bool admits(const Pose& X_WT, double tolerance_m) const noexcept override;

  /// Sees to it that the planes held admit a pose that overlaps nothing: takes the widest apart where they do
  /// not. RT safe.
  void admit(const Pose& X_WT, double tolerance_m) noexcept;

  /// Looks at every plane worth a try from this pose: all faces, and all pairs of edges where there are not
  /// too many. Holds for each convex obstacle the one that separates best, or least badly. Returns how many
  /// there are to open(). RT safe, but dear.
  std::size_t survey(const Pose& X_WT) noexcept;
  /// Holds the planes of the last survey, with its i-th, the least deep first, in the place of one of them.
  void open(std::size_t i) noexcept;

  /// Lets the planes held stand still in the world, as they stand at this pose. RT safe.
  void fix_to_world(const Pose& X_WT) noexcept;

  /// Collects the planes other than those held that admit this pose, the widest apart first, among the
  /// features that touch the planes held. Returns how many. RT safe.
  std::size_t find_near_choices(const Pose& X_WT) noexcept;

  /// Holds the i-th of them.
  void take(std::size_t i) noexcept { planes_[choices_[i].obstacle] = choices_[i].plane; }

  const std::vector<HeldPlane>& held() const noexcept { return planes_; }
  /// planes: of this scene. RT safe.
  void hold(const std::vector<HeldPlane>& planes) noexcept { planes_ = planes; }

  /// Do the planes held press where both bodies are? Then no other plane does better: the forces that keep
  /// the tool at q also balance on the plane. RT safe.
  bool settled(const Projection& q) noexcept;

 private:
  struct Choice {
    std::uint32_t obstacle;  ///< among the convex ones
    HeldPlane plane;
    double separation_m;
  };
  /// Vertices of both bodies.
  struct Pair {
    std::uint32_t tool_vertex = 0;
    std::uint32_t obstacle_vertex = 0;
  };
  /// Where the contacts with one obstacle press.
  struct Pressure {
    Vector3d centre_W_m = Vector3d::Zero();
    Pair pair;         ///< one of them
    int contacts = 0;  ///< how many carry
  };
  /// Of a plane at one pose.
  struct Normal {
    Vector3d n_W;
    bool degenerate;  ///< parallel edges: no common normal
  };
  /// A plane at one pose.
  struct Standing {
    Vector3d n_W;
    Pair nearest;
    double separation_m;
    bool degenerate;  ///< as in Normal
  };

  static constexpr std::size_t kMaxChoices = 96;        ///< for one obstacle
  static constexpr std::size_t kMaxOpenings = 288;      ///< for all
  static constexpr std::size_t kMaxEdgePairs = 200000;  ///< compared at once by survey(): some milliseconds

  void add_convex(std::uint32_t k, const Frame& X_WT, double tolerance_m, std::size_t most,
                  ContactSet& contacts) const noexcept;
  static Normal normal_of(const HeldPlane& plane, const Frame& X_WT) noexcept;
  bool far_above(std::uint32_t k, const Vector3d& n_W, const Frame& X_WT) const noexcept;
  Standing stand(std::uint32_t k, const Normal& normal, const Frame& X_WT) const noexcept;
  double separation_m(std::uint32_t k, const Vector3d& n_W, Pair pair, const Frame& X_WT) const noexcept;
  bool separates(std::uint32_t k, const Frame& X_WT, double tolerance_m) const noexcept;
  bool out_of_reach(std::uint32_t k, const Frame& X_WT) const noexcept;
  std::optional<Pressure> pressure_of(std::uint32_t k, const Projection& q) const noexcept;
  bool press_settled(std::uint32_t k, const Projection& q) noexcept;
  bool holds(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
             const Vector3d& p_m) noexcept;
  void consider(std::uint32_t k, HeldPlane plane, const Frame& X_WT, double least_separation_m) noexcept;
  void consider_between_centres(std::uint32_t k, const Frame& X_WT) noexcept;
  void consider_faces(std::uint32_t k, const Frame& X_WT) noexcept;
  void consider_edge_pairs(std::uint32_t k, const Frame& X_WT) noexcept;
  void consider_edge_pair(std::uint32_t k, const Frame& X_WT, const ConvexBody::Edge& a,
                          const ConvexBody::Edge& b, double least_separation_m) noexcept;
  void collect_touching(const ConvexBody& body, const Vector3d& normal, std::uint32_t farthest,
                        std::vector<std::uint32_t>& out) const noexcept;
  void consider_near(std::uint32_t k, const Standing& held, const Frame& X_WT) noexcept;
  void consider_widest(std::uint32_t k, const Frame& X_WT) noexcept;
  void sort_choices() noexcept;

  const Scene& scene_;
  HalfSpaceContacts half_spaces_;
  std::vector<HeldPlane> planes_;  ///< one for each convex obstacle
  std::vector<HeldPlane> best_;    ///< of the last survey
  std::vector<Choice> choices_;
  std::vector<Choice> openings_;
  mutable std::vector<Pair> last_;  ///< what was found nearest last: where to look first
  LeastDistance<3, 64> widest_;
  std::vector<std::uint32_t> touching_;  ///< vertices, of the tool where both bodies are looked at
  std::vector<std::uint32_t> obstacle_touching_;
};

}  // namespace wrenchd
