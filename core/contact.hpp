// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/pose.hpp"

namespace wrenchd {

/// A vertex of the tool that a face of the scene must keep out (section 2 of the method):
///
///   gap(q) = n_W . (R a + x) - o        q = (R, x)        > 0 apart, < 0 overlapping
///
/// T is the tool's body frame at its centre of mass.
struct Contact {
  Vector3d p_TA_m = Vector3d::Zero();  ///< a: the vertex in T [m]
  Vector3d n_W = Vector3d::UnitZ();    ///< unit normal of the face, points out of the solid
  double offset_m = 0.0;               ///< o: the face lies in n_W . x = o
  std::uint32_t vertex = 0;            ///< which vertex of the tool
  std::uint32_t obstacle = 0;          ///< which obstacle of the scene
};

/// Signed gap of a contact at a pose of T [m]. RT safe.
inline double gap_m(const Contact& c, const Pose& X_WT) noexcept {
  return c.n_W.dot(X_WT * c.p_TA_m) - c.offset_m;
}

inline bool same_features(const Contact& a, const Contact& b) noexcept {
  return a.vertex == b.vertex && a.obstacle == b.obstacle;
}

/// Contacts of one query. The capacity is fixed, so that a tick never allocates. Adding to a full set does
/// nothing.
class ContactSet {
 public:
  static constexpr std::size_t kCapacity = 64;  ///< an optimum of 6 unknowns has few active contacts

  std::size_t size() const noexcept { return size_; }
  bool full() const noexcept { return size_ == kCapacity; }
  const Contact& operator[](std::size_t i) const noexcept { return contacts_[i]; }
  const Contact* begin() const noexcept { return contacts_.data(); }
  const Contact* end() const noexcept { return contacts_.data() + size_; }

  bool contains(const Contact& c) const noexcept {
    for (const Contact& mine : *this)
      if (same_features(mine, c)) return true;
    return false;
  }
  bool add(const Contact& c) noexcept {
    if (full()) return false;
    contacts_[size_++] = c;
    return true;
  }
  void remove_unordered(std::size_t i) noexcept { contacts_[i] = contacts_[--size_]; }
  void clear() noexcept { size_ = 0; }

 private:
  std::array<Contact, kCapacity> contacts_{};
  std::size_t size_ = 0;
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
};

}  // namespace wrenchd
