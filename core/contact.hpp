// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Which features of tool (A) and obstacle (B) meet, and with it how the normal moves (section 2 of the
/// method).
enum class ContactKind : std::uint8_t {
  vertex_face,  ///< a face of the obstacle: the normal stands still in the world
  face_vertex,  ///< a face of the tool: the normal turns with the tool
  edge_edge,    ///< two edges: the normal is their common one
};

/// A feature pair with a signed gap. T is the tool's body frame at its centre of mass, q = (R, x) its pose:
///
///   gap(q) = n(q) . (R a + x - b)        > 0 apart, < 0 overlapping
///
///   vertex_face   n = n_W
///   face_vertex   n = R d_T              d_T = -(outward normal of the tool's face)
///   edge_edge     n = R d_T x d_W / |R d_T x d_W|        d_T, d_W: along the edges, so that n leaves B
struct Contact {
  ContactKind kind = ContactKind::vertex_face;
  Vector3d p_TCa_m = Vector3d::Zero();  ///< a: a point of the tool's feature, in T [m]
  Vector3d p_WCb_m = Vector3d::Zero();  ///< b: a point of the obstacle's feature, in W [m]
  Vector3d n_W = Vector3d::UnitZ();     ///< unit normal from B to A, at the pose where the contact was found
  double offset_m = 0.0;                ///< n_W . b, known better than from b for a face [m]
  Vector3d d_T = Vector3d::Zero();      ///< see above; zero for vertex_face
  Vector3d d_W = Vector3d::Zero();      ///< see above; zero but for edge_edge
  /// Which vertex, edge or face touches. Convex bodies name the vertex that a or b is; 0 for the face of
  /// vertex_face.
  std::uint32_t tool_feature = 0;
  std::uint32_t obstacle_feature = 0;
  std::uint32_t obstacle = 0;  ///< which obstacle of the scene
};

/// Unit normal of a contact at a pose of T, from the obstacle to the tool. RT safe.
inline Vector3d normal_W(const Contact& c, const Pose& X_WT) noexcept {
  switch (c.kind) {
    case ContactKind::face_vertex:
      return X_WT.rotation * c.d_T;
    case ContactKind::edge_edge:
      return (X_WT.rotation * c.d_T).cross(c.d_W).normalized();
    case ContactKind::vertex_face:
      break;
  }
  return c.n_W;
}

/// Signed gap of a contact at a pose of T [m]. RT safe.
inline double gap_m(const Contact& c, const Pose& X_WT) noexcept {
  if (c.kind == ContactKind::vertex_face) return c.n_W.dot(X_WT * c.p_TCa_m) - c.offset_m;
  return normal_W(c, X_WT).dot(X_WT * c.p_TCa_m - c.p_WCb_m);
}

/// Where the two features touch, or would: the tool's vertex, the obstacle's, or where its edge passes the
/// tool's [m]. RT safe.
inline Vector3d contact_point_W(const Contact& c, const Pose& X_WT) noexcept {
  if (c.kind == ContactKind::face_vertex) return c.p_WCb_m;
  if (c.kind == ContactKind::vertex_face) return X_WT * c.p_TCa_m;
  const Vector3d a_W = X_WT * c.p_TCa_m;
  const Vector3d d = X_WT.rotation * c.d_T;
  const Vector3d N = d.cross(c.d_W);
  return a_W + d * ((c.p_WCb_m - a_W).cross(c.d_W).dot(N) / N.squaredNorm());
}

/// A contact whose obstacle has moved by `motion`, in the world: X_WO after it = motion * X_WO before. RT
/// safe.
inline Contact moved(Contact c, const Pose& motion) noexcept {
  c.p_WCb_m = motion * c.p_WCb_m;
  c.offset_m += c.n_W.dot(motion.rotation.conjugate() * motion.translation_m);
  c.n_W = motion.rotation * c.n_W;
  c.d_W = motion.rotation * c.d_W;
  return c;
}

/// Do the normals of two contacts move as one? Those of an obstacle that moves are turned with it, to
/// rounding.
inline bool same_normal(const Contact& a, const Contact& b) noexcept {
  constexpr double kRounding = 1e-10;
  const auto same = [](const Vector3d& x, const Vector3d& y) {
    return (x - y).squaredNorm() <= kRounding * kRounding;
  };
  return a.kind == b.kind && a.obstacle == b.obstacle && a.d_T == b.d_T && same(a.d_W, b.d_W) &&
         (a.kind != ContactKind::vertex_face || same(a.n_W, b.n_W));
}

/// The same pair with the same law of its normal.
inline bool same_features(const Contact& a, const Contact& b) noexcept {
  return a.tool_feature == b.tool_feature && a.obstacle_feature == b.obstacle_feature && same_normal(a, b);
}

/// Contacts of one query. The capacity is fixed, so that a tick never allocates; an optimum of 6 unknowns has
/// few active contacts.
class ContactSet : public StaticVector<Contact, 64> {
 public:
  static constexpr std::size_t kCapacity = 64;

  bool contains(const Contact& c) const noexcept {
    for (const Contact& mine : *this)
      if (same_features(mine, c)) return true;
    return false;
  }
};

/// What the projection asks of a scene: which contacts does a pose violate? A scene of any size answers with
/// the few that matter, so the projection never lists them all (constraint generation).
class ContactSource {
 public:
  virtual ~ContactSource() = default;

  /// Adds contacts that the pose violates by more than tolerance_m and that are not in the set yet: the
  /// deepest of each obstacle. Returns how many were added; 0 means that the pose is admissible, or that the
  /// set is full. X_WT: pose of the tool's body frame in the world. RT safe.
  virtual std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                                   ContactSet& contacts) const noexcept = 0;

  /// Adds all contacts that are no farther apart than within_m at this pose and not in the set yet, as far as
  /// there is room. RT safe.
  virtual void add_touching(const Pose& X_WT, double within_m, ContactSet& contacts) const noexcept = 0;

  /// Is there no contact that add_violated would add to an empty set? RT safe.
  virtual bool admits(const Pose& X_WT, double tolerance_m) const noexcept = 0;
};

}  // namespace wrenchd
