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
  static constexpr std::size_t kMostMet = 12;

  struct Findings {
    /// The contacts met, the first on the way first; not all, but never none where there is one.
    FixedList<Contact, kMostMet> met;
    bool overlaps = false;  ///< the end pose overlaps, though nothing was seen on the way: it is too long.
                            ///< Not told of all that do, but of all that are turned far on the way.
    bool complete = true;   ///< false: the way is too long for what may be looked at; nothing is known
    bool late = false;      ///< then: but not for long, what is needed to look at it is being made
  };

  /// The scene is kept by reference.
  explicit MeshContacts(const Scene& scene);
  MeshContacts(const MeshContacts&) = delete;  // a copy would lose the room that is kept
  MeshContacts& operator=(const MeshContacts&) = delete;

  /// Starts from a pose that is admissible at a scene time. RT safe.
  void start_at(const Pose& X_WT, double time_s = 0.0) noexcept;

  /// The way from the start to X_WT, whose contacts are held open by clearance_m, while the obstacles move to
  /// where they stand at time_s. The contacts are told as they stand then. RT safe.
  Findings look(const Pose& X_WT, double clearance_m, WalkBudget& budget, double time_s = 0.0) noexcept;

  /// Once a tick, when the tool has come to X_WT, following a hand that has come to X_WP: prepares for where
  /// it will be. to_spare: visits that may as well be spent on that, if it does not need as many. RT safe.
  void look_ahead(const Pose& X_WT, const Pose& X_WP, WalkBudget& budget, double time_s = 0.0,
                  std::uint32_t to_spare = 0) noexcept;

  /// The share of the way from the start to X_WT that can be looked at now, in a scene where nothing moves.
  /// RT safe.
  double share_listed(const Pose& X_WT) const noexcept { return pairs_.share_listed(X_start_, X_WT); }
  /// What it takes to list pairs, for every tick that a list serves; in visits.
  double visits_per_tick() const noexcept { return pairs_.visits_per_tick(); }

  /// What the looks of this tick took beside the lists, in visits.
  std::uint32_t looking() const noexcept { return looking_; }

  /// The tool is elsewhere now. RT safe.
  void forget() noexcept { pairs_.forget(); }

  /// The contacts that touch at the end looked at last, with their gap no wider than the clearance, and
  /// rounding.
  const ContactSet& touching() const noexcept { return touching_; }

  std::size_t pairs() const noexcept { return pairs_.listed().pairs().size(); }  ///< listed

 private:
  struct Crossing {
    double when;  ///< 0 at the start, 1 at the end
    Vector3d point_W_m;
    Contact contact;
  };
  /// One obstacle, seen along the way.
  struct Seen {
    const MeshObstacle* obstacle;
    std::uint32_t number;  ///< in the scene
    Frame X_WO;            ///< at the end
    Frame X_OT_start, X_OT_end;
  };
  /// A triangle of the tool as an obstacle sees it, at both ends.
  struct Moved {
    std::uint32_t triangle = MeshSurface::kNone;
    std::uint32_t obstacle = MeshSurface::kNone;
    Triangle start, end;
    MeshSurface::Plane plane_start, plane_end;
  };
  using Heights = std::array<double, 3>;  ///< of a triangle's corners over a plane [m]

  /// Two edges on the way; in the obstacle's frame.
  struct EdgesPass {
    std::uint32_t edge_a, edge_b;
    Vector3d a0_start, a0_end, da_start, da_end, b0, db;
    Vector3d p;   ///< where they meet
    double sign;  ///< of the cross product of da and db that points out of the obstacle
  };

  void see_way(const Pose& X_WT, double time_s) noexcept;
  void look_at_pairs(WalkBudget& budget, Findings& findings) noexcept;
  bool kept_apart(const Heights& start_m, const Heights& end_m, double least_m) const noexcept;
  const Moved& moved(const NearPair& pair) noexcept;
  bool closes(double start_m, double end_m) const noexcept;
  void look_at(const NearPair& pair, const Moved& a, Findings& findings) noexcept;
  void vertices_on_face(const Seen& seen, const NearPair& pair, const Moved& a) noexcept;
  void face_on_vertices(const Seen& seen, const NearPair& pair) noexcept;
  void edges_on_edges(const Seen& seen, const NearPair& pair, const Moved& a, Findings& findings) noexcept;
  void edge_on_edge(const Seen& seen, const Moved& a, std::uint32_t edge_a, std::uint32_t edge_b,
                    Findings& findings) noexcept;
  bool meet(const Seen& seen, EdgesPass& pass, double when, double beyond_m) const noexcept;
  void crossed(double when, const Vector3d& point_W_m, const Contact& contact) noexcept;
  void choose_first(Findings& findings) noexcept;
  void make_sure(WalkBudget& budget, Findings& findings) noexcept;

  const Scene& scene_;
  PairsAhead pairs_;

  Pose X_start_;
  double start_s_ = 0.0;
  std::vector<Seen> seen_;  ///< all obstacles
  double clearance_m_ = 0.0;
  double way_m_ = 0.0;     ///< the longest that an obstacle sees a point of the tool go
  double turn_rad_ = 0.0;  ///< likewise, how far it turns
  double bulge_m_ = 0.0;   ///< by how much a way may leave the straight line as it turns
  double border_m_ = 0.0;  ///< by how much features may miss each other as they cross
  double slope_ = 0.0;     ///< by which their surroundings may seem to come first

  std::vector<std::uint32_t> left_;  ///< of the pairs listed: those that may meet on the way
  SeparatingAxes axes_;
  Moved moved_;
  std::uint32_t looked_at_ = 0;  ///< pairs that no plane keeps apart
  std::vector<Crossing> crossings_;
  TreeWalk walk_;  ///< of make_sure()
  std::uint32_t looking_ = 0;
  bool in_doubt_ = false;  ///< it told of an overlap in this tick
  ContactSet touching_;
};

}  // namespace wrenchd
