// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: compiled once for every kind of processor, each in a namespace of its own, and included
// nowhere else. WRENCHD_WALK names the function.

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/float8.hpp"

namespace wrenchd::simd {
namespace {

static_assert(kWidth == TriangleBvh::kWidth);

WRENCHD_INLINE float magnitude(float x) noexcept {
  return x < 0.0F ? -x : x;
}
WRENCHD_INLINE float dot(const float* a, const float* b) noexcept {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
WRENCHD_INLINE void turned(const Transform& X, const float* p, float* out) noexcept {
  for (int i = 0; i < 3; ++i) out[i] = dot(X.R[i], p);
}

/// One box, seen from the other tree, grown so that it holds what it passes through.
struct SweptBox {
  float centre[3], axis[3][3], half[3];
};

/// Half way it stands at `middle`. Its own points leave the straight way of its centre by half the turn times
/// their distance from it.
WRENCHD_INLINE SweptBox swept(const TriangleBvh::Box& box, const Transform& middle, const Transform& travel,
                              const RelativeMotion& motion) noexcept {
  SweptBox out;
  turned(middle, box.centre, out.centre);
  float way[3];
  turned(travel, box.centre, way);
  for (int d = 0; d < 3; ++d) {
    out.centre[d] += middle.t[d];
    way[d] += travel.t[d];
  }
  turned(middle, box.axis[0], out.axis[0]);
  turned(middle, box.axis[1], out.axis[1]);
  for (int d = 0; d < 3; ++d) {
    const int e = (d + 1) % 3, f = (d + 2) % 3;
    out.axis[2][d] = out.axis[0][e] * out.axis[1][f] - out.axis[0][f] * out.axis[1][e];
  }
  const float more = motion.half_angle * (box.half[0] + box.half[1] + box.half[2]) + motion.margin;
  for (int i = 0; i < 3; ++i) out.half[i] = box.half[i] + 0.5F * magnitude(dot(way, out.axis[i])) + more;
  return out;
}

/// Which of the eight boxes of a node meet a box, by all fifteen axes that may separate two boxes: the faces'
/// normals of both, and their edges' cross products.
WRENCHD_INLINE unsigned meeting(const SweptBox& s, const TriangleBvh::Node& node) noexcept {
  constexpr float kParallel = 1e-6F;  // where two axes are parallel their cross product says nothing
  Float8 between[3], half[3];
  for (int d = 0; d < 3; ++d) {
    between[d] = load(node.centre[d]) - s.centre[d];
    half[d] = load(node.half[d]);
  }
  Float8 t[3], R[3][3], Q[3][3];
  for (int i = 0; i < 3; ++i) {
    t[i] = between[0] * s.axis[i][0] + between[1] * s.axis[i][1] + between[2] * s.axis[i][2];
    for (int j = 0; j < 3; ++j) {
      R[i][j] = load(node.axis[j][0]) * s.axis[i][0] + load(node.axis[j][1]) * s.axis[i][1] +
                load(node.axis[j][2]) * s.axis[i][2];
      Q[i][j] = magnitude(R[i][j]) + kParallel;
    }
  }
  Float8 gap = magnitude(t[0]) - (s.half[0] + half[0] * Q[0][0] + half[1] * Q[0][1] + half[2] * Q[0][2]);
  for (int i = 1; i < 3; ++i)
    gap = larger(gap,
                 magnitude(t[i]) - (s.half[i] + half[0] * Q[i][0] + half[1] * Q[i][1] + half[2] * Q[i][2]));
  for (int j = 0; j < 3; ++j)
    gap = larger(gap, magnitude(t[0] * R[0][j] + t[1] * R[1][j] + t[2] * R[2][j]) -
                          (half[j] + s.half[0] * Q[0][j] + s.half[1] * Q[1][j] + s.half[2] * Q[2][j]));
  Mask8 meet = gap <= 0.0F;
  if (bits(meet) == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      meet &= magnitude(t[i2] * R[i1][j] - t[i1] * R[i2][j]) <=
              s.half[i1] * Q[i2][j] + s.half[i2] * Q[i1][j] + half[j1] * Q[i][j2] + half[j2] * Q[i][j1];
    }
  }
  return bits(meet);
}

/// The triangles of a leaf of A as B sees them, at the start and at the end.
struct alignas(64) MovedLeaf {
  SweptBox box;
  float corner[2][3][3][kWidth];  ///< [start, end][which][component]
  float low[3][kWidth], high[3][kWidth];
  float low_of_all[3], high_of_all[3];
  float normal[2][3][kWidth], offset[2][kWidth];
  std::uint32_t leaf;
};
constexpr std::uint32_t kMovedLeaves = kMovedLeavesBytes / sizeof(MovedLeaf);
static_assert(kMovedLeaves >= 64);

void move(const TriangleBvh::Leaf& leaf, const TriangleBvh::Box& box, const RelativeMotion& motion,
          MovedLeaf& out) noexcept {
  out.box = swept(box, motion.X_BA_middle, motion.displacement_BA, motion);
  const Transform* ends[2] = {&motion.X_BA_start, &motion.X_BA_end};
  Float8 low[3], high[3];
  for (int e = 0; e < 2; ++e) {
    const Transform& X = *ends[e];
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) {
        const Float8 p = load(leaf.corner[i][0]) * X.R[d][0] + load(leaf.corner[i][1]) * X.R[d][1] +
                         load(leaf.corner[i][2]) * X.R[d][2] + X.t[d];
        store(out.corner[e][i][d], p);
        low[d] = e + i == 0 ? p : smaller(low[d], p);
        high[d] = e + i == 0 ? p : larger(high[d], p);
      }
    Float8 offset = all(0.0F);
    for (int d = 0; d < 3; ++d) {
      const Float8 n = load(leaf.normal[0]) * X.R[d][0] + load(leaf.normal[1]) * X.R[d][1] +
                       load(leaf.normal[2]) * X.R[d][2];
      store(out.normal[e][d], n);
      offset += n * X.t[d];
    }
    store(out.offset[e], offset + load(leaf.offset));
  }
  for (int d = 0; d < 3; ++d) {
    store(out.low[d], low[d] - motion.margin);
    store(out.high[d], high[d] + motion.margin);
    out.low_of_all[d] = out.low[d][0];
    out.high_of_all[d] = out.high[d][0];
    for (int i = 1; i < kWidth; ++i) {
      out.low_of_all[d] = out.low[d][i] < out.low_of_all[d] ? out.low[d][i] : out.low_of_all[d];
      out.high_of_all[d] = out.high[d][i] > out.high_of_all[d] ? out.high[d][i] : out.high_of_all[d];
    }
  }
}

/// Which of eight planes, normal . x = offset, have no part of a box within `margin` of them.
WRENCHD_INLINE Mask8 miss(const float (*normal)[kWidth], const float* offset, const SweptBox& box,
                          float margin) noexcept {
  const Float8 nx = load(normal[0]), ny = load(normal[1]), nz = load(normal[2]);
  const Float8 height = nx * box.centre[0] + ny * box.centre[1] + nz * box.centre[2] - load(offset);
  Float8 half = all(margin);
  for (int i = 0; i < 3; ++i)
    half += magnitude(nx * box.axis[i][0] + ny * box.axis[i][1] + nz * box.axis[i][2]) * box.half[i];
  return magnitude(height) > half;
}

/// The planes of eight triangles of A, at both ends, that leave a box of B on the same side.
WRENCHD_INLINE Mask8 miss(const MovedLeaf& a, const SweptBox& box, float margin, bool moving) noexcept {
  const Mask8 end = miss(a.normal[1], a.offset[1], box, margin);
  if (!moving) return end;
  const auto side = [&](int e) {
    return load(a.normal[e][0]) * box.centre[0] + load(a.normal[e][1]) * box.centre[1] +
           load(a.normal[e][2]) * box.centre[2] - load(a.offset[e]);
  };
  return end & miss(a.normal[0], a.offset[0], box, margin) & (side(0) * side(1) > 0.0F);
}

/// A box that stands still.
WRENCHD_INLINE SweptBox standing(const TriangleBvh::Box& box) noexcept {
  SweptBox out;
  for (int d = 0; d < 3; ++d) {
    const int e = (d + 1) % 3, f = (d + 2) % 3;
    out.centre[d] = box.centre[d];
    out.half[d] = box.half[d];
    out.axis[0][d] = box.axis[0][d];
    out.axis[1][d] = box.axis[1][d];
    out.axis[2][d] = box.axis[0][e] * box.axis[1][f] - box.axis[0][f] * box.axis[1][e];
  }
  return out;
}

/// Which of eight boxes lie beside another.
WRENCHD_INLINE Mask8 beside(const float (*low)[kWidth], const float (*high)[kWidth], const float* other_low,
                            const float* other_high) noexcept {
  Mask8 apart = load(low[0]) > other_high[0];
  apart |= load(high[0]) < other_low[0];
  for (int d = 1; d < 3; ++d) {
    apart |= load(low[d]) > other_high[d];
    apart |= load(high[d]) < other_low[d];
  }
  return apart;
}

/// Triangle i of a leaf of A against the eight of a leaf of B: which are kept apart neither by their bounds
/// nor by a plane of one of the two.
WRENCHD_INLINE unsigned near(const MovedLeaf& a, int i, const TriangleBvh::Leaf& b, Mask8 apart, float margin,
                             float margin_of_plane, bool moving) noexcept {
  apart |= load(b.low[0]) > a.high[0][i];
  apart |= load(b.high[0]) < a.low[0][i];
  for (int d = 1; d < 3; ++d) {
    apart |= load(b.low[d]) > a.high[d][i];
    apart |= load(b.high[d]) < a.low[d][i];
  }
  if (bits(apart) == 255) return 0;
  const int first = moving ? 0 : 1;
  {
    Float8 lowest = all(3e38F), highest = all(-3e38F);
    const Float8 nx = load(b.normal[0]), ny = load(b.normal[1]), nz = load(b.normal[2]);
    const Float8 offset = load(b.offset);
    for (int e = first; e < 2; ++e)
      for (int k = 0; k < 3; ++k) {
        const Float8 h =
            nx * a.corner[e][k][0][i] + ny * a.corner[e][k][1][i] + nz * a.corner[e][k][2][i] - offset;
        lowest = smaller(lowest, h);
        highest = larger(highest, h);
      }
    apart |= lowest > margin;
    apart |= highest < -margin;
  }
  if (bits(apart) == 255) return 0;
  {
    Float8 lowest = all(3e38F), highest = all(-3e38F);
    for (int e = first; e < 2; ++e)
      for (int k = 0; k < 3; ++k) {
        const Float8 h = load(b.corner[k][0]) * a.normal[e][0][i] + load(b.corner[k][1]) * a.normal[e][1][i] +
                         load(b.corner[k][2]) * a.normal[e][2][i] - a.offset[e][i];
        lowest = smaller(lowest, h);
        highest = larger(highest, h);
      }
    apart |= lowest > margin_of_plane;
    apart |= highest < -margin_of_plane;
  }
  return bits(apart) ^ 255U;
}

/// Heights of the corners of eight triangles, or of one over eight planes.
struct Heights {
  Float8 h[3];

  WRENCHD_INLINE Mask8 one_side(float margin) const noexcept {
    const Mask8 above = smaller(smaller(h[0], h[1]), h[2]) > margin;
    return above | (larger(larger(h[0], h[1]), h[2]) < -margin);
  }
  WRENCHD_INLINE Float8 least() const noexcept {
    return smaller(smaller(magnitude(h[0]), magnitude(h[1])), magnitude(h[2]));
  }
};

/// Where triangles that planes cut meet them, along the line of the cut, and what the ends may be wrong by.
struct Cuts {
  Float8 low = all(3e38F), high = all(-3e38F), wrong = all(0.0F);

  /// x: the corners' coordinates along the line. A side whose ends lie on two sides of the plane is cut where
  /// its height is zero; heights that are wrong by `margin` shift that place along the side.
  WRENCHD_INLINE Cuts(const Float8 (&x)[3], const Heights& above, float margin) noexcept {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const Float8 drop = above.h[i] - above.h[j], along = x[j] - x[i];
      const Float8 cut = x[i] + along * (above.h[i] / drop);
      const Float8 shift = magnitude(along) * margin / (magnitude(drop) - 2.0F * margin);
      const Mask8 crosses = (above.h[i] > 0.0F) != (above.h[j] > 0.0F);
      low = crosses ? smaller(low, cut) : low;
      high = crosses ? larger(high, cut) : high;
      wrong = crosses ? larger(wrong, shift) : wrong;
    }
  }
};

struct Settled {
  unsigned meet, doubtful;
};

/// Triangle i of a leaf of A against the eight of a leaf of B, at one pose, heights and coordinates wrong by
/// `margin` at most: two triangles meet where each cuts the other's plane, and the cuts overlap on the line
/// where the planes meet. The line has the length of the sine of the planes' angle: where that is so small
/// that rounding could turn it, what overlaps along it is within `margin` too.
WRENCHD_INLINE Settled settle(const MovedLeaf& a, int i, const TriangleBvh::Leaf& b, Mask8 apart,
                              float margin) noexcept {
  for (int d = 0; d < 3; ++d) {
    apart |= load(b.low[d]) > a.high[d][i];
    apart |= load(b.high[d]) < a.low[d][i];
  }
  if (bits(apart) == 255) return {0, 0};
  const float(&corner)[3][3][kWidth] = a.corner[1];
  const float(&normal)[3][kWidth] = a.normal[1];
  const Float8 m[3] = {load(b.normal[0]), load(b.normal[1]), load(b.normal[2])};
  const Float8 offset = load(b.offset);
  Heights a_above, b_above;
  for (int k = 0; k < 3; ++k)
    a_above.h[k] = m[0] * corner[k][0][i] + m[1] * corner[k][1][i] + m[2] * corner[k][2][i] - offset;
  apart |= a_above.one_side(margin);
  if (bits(apart) == 255) return {0, 0};
  Float8 q[3][3];
  for (int k = 0; k < 3; ++k) {
    for (int d = 0; d < 3; ++d) q[k][d] = load(b.corner[k][d]);
    b_above.h[k] = q[k][0] * normal[0][i] + q[k][1] * normal[1][i] + q[k][2] * normal[2][i] - a.offset[1][i];
  }
  apart |= b_above.one_side(margin);
  if (bits(apart) == 255) return {0, 0};
  const float n[3] = {normal[0][i], normal[1][i], normal[2][i]};
  const Float8 line[3] = {m[2] * n[1] - m[1] * n[2], m[0] * n[2] - m[2] * n[0], m[1] * n[0] - m[0] * n[1]};
  // From a corner of A, so that a place far from the origin costs no digits.
  Float8 x_a[3], x_b[3];
  for (int k = 0; k < 3; ++k) {
    x_a[k] = x_b[k] = all(0.0F);
    for (int d = 0; d < 3; ++d) {
      x_a[k] += line[d] * (corner[k][d][i] - corner[0][d][i]);
      x_b[k] += line[d] * (q[k][d] - corner[0][d][i]);
    }
  }
  const Cuts in_a(x_a, a_above, margin), in_b(x_b, b_above, margin);
  const Float8 overlap = smaller(in_a.high, in_b.high) - larger(in_a.low, in_b.low);
  const Float8 wrong = in_a.wrong + in_b.wrong + 2.0F * margin;
  Mask8 clear = smaller(a_above.least(), b_above.least()) > margin;
  clear &= magnitude(overlap) > wrong;
  const unsigned sure = bits(clear), left = bits(apart) ^ 255U;
  return {left & sure & bits(overlap > 0.0F), left & ~sure};
}

/// How far the boxed part of B may be from this place.
WRENCHD_INLINE float distance_bound(const TriangleBvh::Box& box, const float* centre) noexcept {
  float sum = box.half[0] + box.half[1] + box.half[2];
  for (int d = 0; d < 3; ++d) sum += magnitude(box.centre[d] - centre[d]);
  return sum;
}

class Walk {
 public:
  explicit Walk(TraversalJob& job) noexcept : job_(job), moved_(static_cast<MovedLeaf*>(job.moved_leaves)) {}

  void run() noexcept {
    if (!job_.started) {
      for (std::uint32_t k = 0; k < kMovedLeaves; ++k) moved_[k].leaf = ~0U;
      for (std::uint32_t a = 0; a < kWidth; ++a)
        if (job_.a.boxes[a].count >= 0) open_b(a, 0);
      job_.started = true;
    }
    while (job_.stack_top > 0 && !job_.overflow && job_.node_visits < job_.max_node_visits) {
      const std::uint32_t b = job_.stack[--job_.stack_top];
      const std::uint32_t a = job_.stack[--job_.stack_top];
      ++job_.node_visits;
      visit(a, b);
    }
  }

 private:
  /// Opens the larger of two boxes, or looks at the triangles of two leaves.
  void visit(std::uint32_t a, std::uint32_t b) noexcept {
    const TriangleBvh::Box& box_a = job_.a.boxes[a];
    const TriangleBvh::Box& box_b = job_.b.boxes[b];
    if (box_a.count > 0 && box_b.count > 0) {
      meet_leaves(box_a, box_b);
    } else if (box_b.count > 0 || (box_a.count == 0 && box_a.half_area > box_b.half_area)) {
      open_a(box_a.child, b);
    } else {
      open_b(a, box_b.child);
    }
  }

  void open_a(std::uint32_t node, std::uint32_t b) noexcept {
    const RelativeMotion& m = job_.motion;
    if (swept_b_ != b) {
      box_b_ = swept(job_.b.boxes[b], m.X_AB_middle, m.displacement_AB, m);
      swept_b_ = b;
    }
    const TriangleBvh::Node& eight = job_.a.nodes[node];
    const unsigned worth = worth_it(job_.b.boxes[b].features, eight.has_vertices, eight.has_edges);
    for (unsigned hits = meeting(box_b_, eight) & worth; hits != 0; hits &= hits - 1)
      push(kWidth * node + static_cast<unsigned>(__builtin_ctz(hits)), b);
  }

  void open_b(std::uint32_t a, std::uint32_t node) noexcept {
    const RelativeMotion& m = job_.motion;
    if (swept_a_ != a) {
      box_a_ = swept(job_.a.boxes[a], m.X_BA_middle, m.displacement_BA, m);
      swept_a_ = a;
    }
    const TriangleBvh::Node& eight = job_.b.nodes[node];
    const unsigned worth = worth_it(job_.a.boxes[a].features, eight.has_vertices, eight.has_edges);
    for (unsigned hits = meeting(box_a_, eight) & worth; hits != 0; hits &= hits - 1)
      push(a, kWidth * node + static_cast<unsigned>(__builtin_ctz(hits)));
  }

  /// Which of eight have features that can meet those of another first.
  unsigned worth_it(unsigned features, unsigned has_vertices, unsigned has_edges) const noexcept {
    if (job_.motion.all_pairs || (features & TriangleBvh::kVertices) != 0) return 255;
    return (features & TriangleBvh::kEdges) != 0 ? has_vertices | has_edges : has_vertices;
  }

  void push(std::uint32_t a, std::uint32_t b) noexcept {
    if (job_.stack_top + 2 > 2 * kStack) {
      job_.overflow = true;
      return;
    }
    job_.stack[job_.stack_top++] = a;
    job_.stack[job_.stack_top++] = b;
  }

  const MovedLeaf& moved(const TriangleBvh::Box& box) noexcept {
    MovedLeaf& slot = moved_[box.child % kMovedLeaves];
    if (slot.leaf != box.child) {
      move(job_.a.leaves[box.child], box, job_.motion, slot);
      slot.leaf = box.child;
    }
    return slot;
  }

  void meet_leaves(const TriangleBvh::Box& box_a, const TriangleBvh::Box& box_b) noexcept {
    const RelativeMotion& m = job_.motion;
    const MovedLeaf& a = moved(box_a);
    const TriangleBvh::Leaf& b = job_.b.leaves[box_b.child];
    Mask8 apart = beside(b.low, b.high, a.low_of_all, a.high_of_all);
    if (bits(apart) == 255) return;
    apart |= miss(b.normal, b.offset, a.box, 0.0F);  // the box has its margin
    if (bits(apart) == 255) return;
    unsigned rows = (1U << box_a.count) - 1;
    rows &= ~bits(beside(a.low, a.high, b.bounds_low, b.bounds_high));
    if (rows == 0) return;
    if (m.classify) {
      settle_leaves(box_a, a, b, rows & ~bits(miss(a, standing(box_b), m.rounding, false)), apart);
      return;
    }
    const float far = (distance_bound(box_b, m.centre_B) + m.centre_travel) / m.radius;
    const float margin_of_plane = m.rounding + m.reach * (far > 1.0F ? far : 1.0F);
    for (rows &= ~bits(miss(a, standing(box_b), margin_of_plane, m.moving)); rows != 0; rows &= rows - 1) {
      const int i = __builtin_ctz(rows);
      const TriangleBvh::Leaf& leaf_a = job_.a.leaves[box_a.child];
      const std::uint32_t ta = leaf_a.triangle[i];
      const unsigned features = ((leaf_a.has_vertices >> i) & 1U) | (((leaf_a.has_edges >> i) & 1U) << 1);
      const unsigned worth = worth_it(features, b.has_vertices, b.has_edges);
      if (worth == 0) continue;
      for (unsigned hits = near(a, i, b, apart, m.margin, margin_of_plane, m.moving) & worth; hits != 0;
           hits &= hits - 1) {
        if (job_.pair_count == job_.capacity) {
          job_.overflow = true;
          return;
        }
        job_.pairs[job_.pair_count++] = {ta, b.triangle[__builtin_ctz(hits)]};
      }
    }
  }

  void settle_leaves(const TriangleBvh::Box& box_a, const MovedLeaf& a, const TriangleBvh::Leaf& b,
                     unsigned rows, Mask8 apart) noexcept {
    const std::uint32_t* triangle_a = job_.a.leaves[box_a.child].triangle;
    for (; rows != 0; rows &= rows - 1) {
      const int i = __builtin_ctz(rows);
      const auto [meet, doubtful] = settle(a, i, b, apart, job_.motion.margin);
      if (job_.pair_count + job_.intersecting_count + kWidth > job_.capacity) {
        job_.overflow = true;
        return;
      }
      for (unsigned hits = meet; hits != 0; hits &= hits - 1)
        job_.pairs[job_.capacity - ++job_.intersecting_count] = {triangle_a[i],
                                                                 b.triangle[__builtin_ctz(hits)]};
      for (unsigned hits = doubtful; hits != 0; hits &= hits - 1)
        job_.pairs[job_.pair_count++] = {triangle_a[i], b.triangle[__builtin_ctz(hits)]};
    }
  }

  TraversalJob& job_;
  MovedLeaf* moved_;
  std::uint32_t swept_a_ = ~0U, swept_b_ = ~0U;  ///< often the same one again
  SweptBox box_a_, box_b_;
};

}  // namespace

void WRENCHD_WALK(TraversalJob& job) noexcept {
  Walk(job).run();
}

}  // namespace wrenchd::simd
