// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Kind of the feature pair of tool and obstacle. The kind determines how the contact normal depends on the
/// tool pose (core/METHOD.md, section 3.1).
enum class ContactKind : std::uint8_t {
  vertex_face,  ///< tool vertex and obstacle face; the normal is constant in the world
  face_vertex,  ///< tool face and obstacle vertex; the normal rotates with the tool
  edge_edge,    ///< tool edge and obstacle edge; the normal is perpendicular to both edges
};

/// A feature pair with a signed gap, METHOD (17), (18). T is the tool's body frame at its centre of mass, q =
/// (R, x) its pose:
///
///   gap(q) = n(q) . (R a + x - b)        > 0 apart, < 0 overlapping
///
///   vertex_face   n = n_W
///   face_vertex   n = R d_T              d_T = -(outward normal of the tool's face)
///   edge_edge     n = R d_T x d_W / |R d_T x d_W|        d_T, d_W: edge directions, signed so that n leaves
///   the obstacle
struct Contact {
  ContactKind kind = ContactKind::vertex_face;
  Vector3d p_TCa_m = Vector3d::Zero();  ///< a: point on the tool feature, in T [m]
  Vector3d p_WCb_m = Vector3d::Zero();  ///< b: point on the obstacle feature, in W [m]
  /// unit normal from obstacle to tool, at the pose where the contact was found
  Vector3d n_W = Vector3d::UnitZ();
  double offset_m = 0.0;  ///< n_W . b; for an obstacle face more accurate than the product of n_W and b [m]
  /// d_T of the normal's equation: negative face normal or edge direction in T; zero for vertex_face
  Vector3d d_T = Vector3d::Zero();
  /// d_W of the normal's equation: edge direction in W; zero for vertex_face and face_vertex
  Vector3d d_W = Vector3d::Zero();
  /// Index of the touching vertex, edge or face. For convex bodies it is the index of the vertex at a or b.
  /// For the obstacle face of vertex_face it is 0.
  std::uint32_t tool_feature = 0;
  std::uint32_t obstacle_feature = 0;
  std::uint32_t obstacle = 0;  ///< index of the obstacle in the scene
};

/// Unit normal of a contact at the tool pose X_WT, from obstacle to tool, in W, METHOD (18). RT-safe.
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

/// Signed gap of a contact at the tool pose X_WT [m], METHOD (17). RT-safe.
inline double gap_m(const Contact& c, const Pose& X_WT) noexcept {
  if (c.kind == ContactKind::vertex_face) return c.n_W.dot(X_WT * c.p_TCa_m) - c.offset_m;
  return normal_W(c, X_WT).dot(X_WT * c.p_TCa_m - c.p_WCb_m);
}

/// Point of contact in W [m], METHOD (19): the tool vertex, the obstacle vertex, or the point of the tool
/// edge that is nearest to the obstacle edge. The features need not touch. RT-safe.
inline Vector3d contact_point_W(const Contact& c, const Pose& X_WT) noexcept {
  if (c.kind == ContactKind::face_vertex) return c.p_WCb_m;
  if (c.kind == ContactKind::vertex_face) return X_WT * c.p_TCa_m;
  const Vector3d a_W = X_WT * c.p_TCa_m;
  const Vector3d d = X_WT.rotation * c.d_T;
  const Vector3d N = d.cross(c.d_W);
  return a_W + d * ((c.p_WCb_m - a_W).cross(c.d_W).dot(N) / N.squaredNorm());
}

/// The same contact after its obstacle moved, METHOD (27). motion: displacement in W, X_WO(after) = motion *
/// X_WO(before). RT-safe.
inline Contact moved(Contact c, const Pose& motion) noexcept {
  c.p_WCb_m = motion * c.p_WCb_m;
  c.offset_m += c.n_W.dot(motion.rotation.conjugate() * motion.translation_m);
  c.n_W = motion.rotation * c.n_W;
  c.d_W = motion.rotation * c.d_W;
  return c;
}

/// True if the normals of both contacts depend on the tool pose in the same way, up to rounding (1e-10).
/// RT-safe.
inline bool same_normal(const Contact& a, const Contact& b) noexcept {
  constexpr double kRounding = 1e-10;
  const auto same = [](const Vector3d& x, const Vector3d& y) {
    return (x - y).squaredNorm() <= kRounding * kRounding;
  };
  return a.kind == b.kind && a.obstacle == b.obstacle && a.d_T == b.d_T && same(a.d_W, b.d_W) &&
         (a.kind != ContactKind::vertex_face || same(a.n_W, b.n_W));
}

/// True if both contacts have the same features and equal normals as in same_normal(). RT-safe.
inline bool same_features(const Contact& a, const Contact& b) noexcept {
  return a.tool_feature == b.tool_feature && a.obstacle_feature == b.obstacle_feature && same_normal(a, b);
}

/// Contacts of one query. The capacity is fixed, so a tick does not allocate. An optimum over 6 unknowns has
/// at most a few active contacts.
class ContactSet : public StaticVector<Contact, 64> {
 public:
  static constexpr std::size_t kCapacity = 64;

  bool contains(const Contact& c) const noexcept {
    for (const Contact& mine : *this)
      if (same_features(mine, c)) return true;
    return false;
  }
};

/// Interface of a scene to the projection: returns contacts that a pose violates. The scene returns only the
/// deepest contacts, so the projection needs no list of all contacts (constraint generation, core/METHOD.md,
/// section 3.7).
class ContactSource {
 public:
  virtual ~ContactSource() = default;

  /// Adds, for each obstacle, the deepest contact whose gap is less than -tolerance_m and that is not in the
  /// set. Returns the number of added contacts. 0 means that the pose is admissible or that the set is full.
  /// X_WT: tool body frame in the world. RT-safe.
  virtual std::size_t add_violated(const Pose& X_WT, double tolerance_m,
                                   ContactSet& contacts) const noexcept = 0;

  /// Adds all contacts whose gap is at most within_m at the pose X_WT and that are not in the set. If the set
  /// is full, drops the rest. RT-safe.
  virtual void add_touching(const Pose& X_WT, double within_m, ContactSet& contacts) const noexcept = 0;

  /// True if add_violated() would add nothing to an empty set at this pose. RT-safe.
  virtual bool admits(const Pose& X_WT, double tolerance_m) const noexcept = 0;
};

}  // namespace wrenchd
