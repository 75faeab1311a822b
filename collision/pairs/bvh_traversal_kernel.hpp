// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: one source file per instruction set includes this header and compiles it in a namespace of
// its own. WRENCHD_TRAVERSE is the name of the function.

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
WRENCHD_INLINE void rotate(const Transform& X, const float* p, float* out) noexcept {
  for (int i = 0; i < 3; ++i) out[i] = dot(X.R[i], p);
}

/// An oriented box in the frame of the other BVH, enlarged to contain its motion.
struct SweptBox {
  float centre[3], axis[3][3], half[3];
};

/// `middle`: pose half way. The points of the box deviate from the path of its centre by at most half the
/// rotation angle times their distance from the centre.
WRENCHD_INLINE SweptBox swept_box(const TriangleBvh::Box& box, const Transform& middle,
                                  const Transform& travel, const RelativeMotion& motion) noexcept {
  SweptBox out;
  rotate(middle, box.centre, out.centre);
  float displacement[3];
  rotate(travel, box.centre, displacement);
  for (int d = 0; d < 3; ++d) {
    out.centre[d] += middle.t[d];
    displacement[d] += travel.t[d];
  }
  rotate(middle, box.axis[0], out.axis[0]);
  rotate(middle, box.axis[1], out.axis[1]);
  for (int d = 0; d < 3; ++d) {
    const int e = (d + 1) % 3, f = (d + 2) % 3;
    out.axis[2][d] = out.axis[0][e] * out.axis[1][f] - out.axis[0][f] * out.axis[1][e];
  }
  const float enlargement = motion.half_angle * (box.half[0] + box.half[1] + box.half[2]) + motion.margin;
  for (int i = 0; i < 3; ++i)
    out.half[i] = box.half[i] + 0.5F * magnitude(dot(displacement, out.axis[i])) + enlargement;
  return out;
}

/// Returns a bit mask of the boxes of a node that overlap a box. Tests all fifteen separating axes of two
/// boxes: the face normals of both and the cross products of their edges.
WRENCHD_INLINE unsigned overlapping(const SweptBox& s, const TriangleBvh::Node& node) noexcept {
  constexpr float kParallel = 1e-6F;  // prevents false separation along the cross product of parallel axes
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
    gap = lane_max(gap,
                   magnitude(t[i]) - (s.half[i] + half[0] * Q[i][0] + half[1] * Q[i][1] + half[2] * Q[i][2]));
  for (int j = 0; j < 3; ++j)
    gap = lane_max(gap, magnitude(t[0] * R[0][j] + t[1] * R[1][j] + t[2] * R[2][j]) -
                            (half[j] + s.half[0] * Q[0][j] + s.half[1] * Q[1][j] + s.half[2] * Q[2][j]));
  Mask8 overlap = gap <= 0.0F;
  if (lane_mask(overlap) == 0) return 0;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      overlap &= magnitude(t[i2] * R[i1][j] - t[i1] * R[i2][j]) <=
                 s.half[i1] * Q[i2][j] + s.half[i2] * Q[i1][j] + half[j1] * Q[i][j2] + half[j2] * Q[i][j1];
    }
  }
  return lane_mask(overlap);
}

/// The triangles of a leaf of A in the frame of B, at the start and at the end of the path.
struct alignas(64) MovedLeaf {
  SweptBox box;
  float corner[2][3][3][kWidth];  ///< [start, end][corner][component]
  float low[3][kWidth], high[3][kWidth];
  float bounds_low[3], bounds_high[3];
  float normal[2][3][kWidth], offset[2][kWidth];
  std::uint32_t leaf;
};
constexpr std::uint32_t kMovedLeaves = kMovedLeavesBytes / sizeof(MovedLeaf);
static_assert(kMovedLeaves >= 64);

void transform_leaf(const TriangleBvh::Leaf& leaf, const TriangleBvh::Box& box, const RelativeMotion& motion,
                    MovedLeaf& out) noexcept {
  out.box = swept_box(box, motion.X_BA_middle, motion.displacement_BA, motion);
  const Transform* ends[2] = {&motion.X_BA_start, &motion.X_BA_end};
  Float8 low[3], high[3];
  for (int e = 0; e < 2; ++e) {
    const Transform& X = *ends[e];
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) {
        const Float8 p = load(leaf.corner[i][0]) * X.R[d][0] + load(leaf.corner[i][1]) * X.R[d][1] +
                         load(leaf.corner[i][2]) * X.R[d][2] + X.t[d];
        store(out.corner[e][i][d], p);
        low[d] = e + i == 0 ? p : lane_min(low[d], p);
        high[d] = e + i == 0 ? p : lane_max(high[d], p);
      }
    Float8 offset = broadcast(0.0F);
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
    out.bounds_low[d] = out.low[d][0];
    out.bounds_high[d] = out.high[d][0];
    for (int i = 1; i < kWidth; ++i) {
      out.bounds_low[d] = out.low[d][i] < out.bounds_low[d] ? out.low[d][i] : out.bounds_low[d];
      out.bounds_high[d] = out.high[d][i] > out.bounds_high[d] ? out.high[d][i] : out.bounds_high[d];
    }
  }
}

/// Returns a mask of the planes, normal . x = offset, that lie more than `margin` away from a box.
WRENCHD_INLINE Mask8 clear_of_box(const float (*normal)[kWidth], const float* offset, const SweptBox& box,
                                  float margin) noexcept {
  const Float8 nx = load(normal[0]), ny = load(normal[1]), nz = load(normal[2]);
  const Float8 height = nx * box.centre[0] + ny * box.centre[1] + nz * box.centre[2] - load(offset);
  Float8 half = broadcast(margin);
  for (int i = 0; i < 3; ++i)
    half += magnitude(nx * box.axis[i][0] + ny * box.axis[i][1] + nz * box.axis[i][2]) * box.half[i];
  return magnitude(height) > half;
}

/// Returns a mask of the planes of eight triangles of A that keep a box of B on one side, at both ends of the
/// path.
WRENCHD_INLINE Mask8 clear_of_box(const MovedLeaf& a, const SweptBox& box, float margin,
                                  bool moving) noexcept {
  const Mask8 end = clear_of_box(a.normal[1], a.offset[1], box, margin);
  if (!moving) return end;
  const auto side = [&](int e) {
    return load(a.normal[e][0]) * box.centre[0] + load(a.normal[e][1]) * box.centre[1] +
           load(a.normal[e][2]) * box.centre[2] - load(a.offset[e]);
  };
  return end & clear_of_box(a.normal[0], a.offset[0], box, margin) & (side(0) * side(1) > 0.0F);
}

/// Converts a box at rest.
WRENCHD_INLINE SweptBox at_rest(const TriangleBvh::Box& box) noexcept {
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

/// Returns a mask of the boxes that do not overlap another box. All boxes are axis-aligned.
WRENCHD_INLINE Mask8 disjoint_bounds(const float (*low)[kWidth], const float (*high)[kWidth],
                                     const float* other_low, const float* other_high) noexcept {
  Mask8 apart = load(low[0]) > other_high[0];
  apart |= load(high[0]) < other_low[0];
  for (int d = 1; d < 3; ++d) {
    apart |= load(low[d]) > other_high[d];
    apart |= load(high[d]) < other_low[d];
  }
  return apart;
}

/// Tests triangle i of a leaf of A against the eight triangles of a leaf of B. Returns a mask of the
/// triangles that neither bounds nor a plane of one of the two triangles separate.
WRENCHD_INLINE unsigned near_triangles(const MovedLeaf& a, int i, const TriangleBvh::Leaf& b, Mask8 apart,
                                       float margin, float margin_of_plane, bool moving) noexcept {
  apart |= load(b.low[0]) > a.high[0][i];
  apart |= load(b.high[0]) < a.low[0][i];
  for (int d = 1; d < 3; ++d) {
    apart |= load(b.low[d]) > a.high[d][i];
    apart |= load(b.high[d]) < a.low[d][i];
  }
  if (lane_mask(apart) == 255) return 0;
  const int first = moving ? 0 : 1;
  {
    Float8 lowest = broadcast(3e38F), highest = broadcast(-3e38F);
    const Float8 nx = load(b.normal[0]), ny = load(b.normal[1]), nz = load(b.normal[2]);
    const Float8 offset = load(b.offset);
    for (int e = first; e < 2; ++e)
      for (int k = 0; k < 3; ++k) {
        const Float8 h =
            nx * a.corner[e][k][0][i] + ny * a.corner[e][k][1][i] + nz * a.corner[e][k][2][i] - offset;
        lowest = lane_min(lowest, h);
        highest = lane_max(highest, h);
      }
    apart |= lowest > margin;
    apart |= highest < -margin;
  }
  if (lane_mask(apart) == 255) return 0;
  {
    Float8 lowest = broadcast(3e38F), highest = broadcast(-3e38F);
    for (int e = first; e < 2; ++e)
      for (int k = 0; k < 3; ++k) {
        const Float8 h = load(b.corner[k][0]) * a.normal[e][0][i] + load(b.corner[k][1]) * a.normal[e][1][i] +
                         load(b.corner[k][2]) * a.normal[e][2][i] - a.offset[e][i];
        lowest = lane_min(lowest, h);
        highest = lane_max(highest, h);
      }
    apart |= lowest > margin_of_plane;
    apart |= highest < -margin_of_plane;
  }
  return lane_mask(apart) ^ 255U;
}

/// Heights of the corners of eight triangles above a plane, or of one triangle above eight planes.
struct Heights {
  Float8 h[3];

  WRENCHD_INLINE Mask8 one_side(float margin) const noexcept {
    const Mask8 above = lane_min(lane_min(h[0], h[1]), h[2]) > margin;
    return above | (lane_max(lane_max(h[0], h[1]), h[2]) < -margin);
  }
  WRENCHD_INLINE Float8 min_distance() const noexcept {
    return lane_min(lane_min(magnitude(h[0]), magnitude(h[1])), magnitude(h[2]));
  }
};

/// The interval in which a plane cuts each of eight triangles, along the line of intersection, and the error
/// bound of its ends.
struct CutIntervals {
  Float8 low = broadcast(3e38F), high = broadcast(-3e38F), error = broadcast(0.0F);

  /// x: coordinates of the corners along the line. A side whose ends lie on both sides of the plane is cut
  /// where its height is zero. An error `margin` of the heights shifts the cut along the side.
  WRENCHD_INLINE CutIntervals(const Float8 (&x)[3], const Heights& heights, float margin) noexcept {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const Float8 drop = heights.h[i] - heights.h[j], along = x[j] - x[i];
      const Float8 cut = x[i] + along * (heights.h[i] / drop);
      const Float8 shift = magnitude(along) * margin / (magnitude(drop) - 2.0F * margin);
      const Mask8 crosses = (heights.h[i] > 0.0F) != (heights.h[j] > 0.0F);
      low = crosses ? lane_min(low, cut) : low;
      high = crosses ? lane_max(high, cut) : high;
      error = crosses ? lane_max(error, shift) : error;
    }
  }
};

struct Classified {
  unsigned intersecting, in_doubt;
};

/// Classifies triangle i of a leaf of A against the eight triangles of a leaf of B at one pose. The errors of
/// heights and coordinates are at most `margin`. Two triangles intersect if each cuts the other's plane and
/// the cuts overlap on the line of intersection of the planes. The line's direction has the length of the
/// sine of the angle between the planes. If rounding could change the direction, the overlap along it is
/// below `margin` too, so the pair is in doubt.
WRENCHD_INLINE Classified classify(const MovedLeaf& a, int i, const TriangleBvh::Leaf& b, Mask8 apart,
                                   float margin) noexcept {
  for (int d = 0; d < 3; ++d) {
    apart |= load(b.low[d]) > a.high[d][i];
    apart |= load(b.high[d]) < a.low[d][i];
  }
  if (lane_mask(apart) == 255) return {0, 0};
  const float(&corner)[3][3][kWidth] = a.corner[1];
  const float(&normal)[3][kWidth] = a.normal[1];
  const Float8 m[3] = {load(b.normal[0]), load(b.normal[1]), load(b.normal[2])};
  const Float8 offset = load(b.offset);
  Heights a_above, b_above;
  for (int k = 0; k < 3; ++k)
    a_above.h[k] = m[0] * corner[k][0][i] + m[1] * corner[k][1][i] + m[2] * corner[k][2][i] - offset;
  apart |= a_above.one_side(margin);
  if (lane_mask(apart) == 255) return {0, 0};
  Float8 q[3][3];
  for (int k = 0; k < 3; ++k) {
    for (int d = 0; d < 3; ++d) q[k][d] = load(b.corner[k][d]);
    b_above.h[k] = q[k][0] * normal[0][i] + q[k][1] * normal[1][i] + q[k][2] * normal[2][i] - a.offset[1][i];
  }
  apart |= b_above.one_side(margin);
  if (lane_mask(apart) == 255) return {0, 0};
  const float n[3] = {normal[0][i], normal[1][i], normal[2][i]};
  const Float8 line[3] = {m[2] * n[1] - m[1] * n[2], m[0] * n[2] - m[2] * n[0], m[1] * n[0] - m[0] * n[1]};
  // Coordinates are relative to a corner of A, so that a position far from the origin loses no digits.
  Float8 x_a[3], x_b[3];
  for (int k = 0; k < 3; ++k) {
    x_a[k] = x_b[k] = broadcast(0.0F);
    for (int d = 0; d < 3; ++d) {
      x_a[k] += line[d] * (corner[k][d][i] - corner[0][d][i]);
      x_b[k] += line[d] * (q[k][d] - corner[0][d][i]);
    }
  }
  const CutIntervals in_a(x_a, a_above, margin), in_b(x_b, b_above, margin);
  const Float8 overlap = lane_min(in_a.high, in_b.high) - lane_max(in_a.low, in_b.low);
  const Float8 error = in_a.error + in_b.error + 2.0F * margin;
  Mask8 clear = lane_min(a_above.min_distance(), b_above.min_distance()) > margin;
  clear &= magnitude(overlap) > error;
  const unsigned certain = lane_mask(clear), candidates = lane_mask(apart) ^ 255U;
  return {candidates & certain & lane_mask(overlap > 0.0F), candidates & ~certain};
}

/// Returns an upper bound for the distance between a box of B and a point.
WRENCHD_INLINE float distance_bound(const TriangleBvh::Box& box, const float* centre) noexcept {
  float sum = box.half[0] + box.half[1] + box.half[2];
  for (int d = 0; d < 3; ++d) sum += magnitude(box.centre[d] - centre[d]);
  return sum;
}

/// Selects the features that count from the bits for both sides. `back`: shift of the bits for the back.
WRENCHD_INLINE unsigned on_sides(unsigned bits, unsigned sides, unsigned back, unsigned mask) noexcept {
  const unsigned front_mask = (sides & MeshSurface::kFront) != 0 ? mask : 0U;
  const unsigned back_mask = (sides & MeshSurface::kBack) != 0 ? mask : 0U;
  return (bits & front_mask) | (bits >> back & back_mask);
}
WRENCHD_INLINE unsigned features_of_box(const TriangleBvh::Box& box, unsigned sides) noexcept {
  return on_sides(box.features, sides, TriangleBvh::kBackOfBox, TriangleBvh::kVertices | TriangleBvh::kEdges);
}
WRENCHD_INLINE unsigned features_of_eight(unsigned bits, unsigned sides) noexcept {
  return on_sides(bits, sides, TriangleBvh::kBackOfEight, 255U);
}

class Traversal {
 public:
  explicit Traversal(TraversalJob& job) noexcept
      : job_(job), moved_(static_cast<MovedLeaf*>(job.moved_leaves)) {}

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
  static constexpr unsigned kSidesOfA = MeshSurface::kBothSides;

  /// Opens the larger of two boxes, or tests the triangles of two leaves.
  void visit(std::uint32_t a, std::uint32_t b) noexcept {
    const TriangleBvh::Box& box_a = job_.a.boxes[a];
    const TriangleBvh::Box& box_b = job_.b.boxes[b];
    if (box_a.count > 0 && box_b.count > 0) {
      test_leaves(box_a, box_b);
    } else if (box_b.count > 0 || (box_a.count == 0 && box_a.half_area > box_b.half_area)) {
      open_a(box_a.child, b);
    } else {
      open_b(a, box_b.child);
    }
  }

  void open_a(std::uint32_t node, std::uint32_t b) noexcept {
    const RelativeMotion& m = job_.motion;
    if (swept_b_ != b) {
      box_b_ = swept_box(job_.b.boxes[b], m.X_AB_middle, m.displacement_AB, m);
      swept_b_ = b;
    }
    const TriangleBvh::Node& eight = job_.a.nodes[node];
    const unsigned useful = relevant(features_of_box(job_.b.boxes[b], m.sides_b),
                                     features_of_eight(eight.has_vertices, kSidesOfA),
                                     features_of_eight(eight.has_edges, kSidesOfA));
    for (unsigned hits = overlapping(box_b_, eight) & useful; hits != 0; hits &= hits - 1)
      push(kWidth * node + static_cast<unsigned>(__builtin_ctz(hits)), b);
  }

  void open_b(std::uint32_t a, std::uint32_t node) noexcept {
    const RelativeMotion& m = job_.motion;
    if (swept_a_ != a) {
      box_a_ = swept_box(job_.a.boxes[a], m.X_BA_middle, m.displacement_BA, m);
      swept_a_ = a;
    }
    const TriangleBvh::Node& eight = job_.b.nodes[node];
    const unsigned useful = relevant(features_of_box(job_.a.boxes[a], kSidesOfA),
                                     features_of_eight(eight.has_vertices, m.sides_b),
                                     features_of_eight(eight.has_edges, m.sides_b));
    for (unsigned hits = overlapping(box_a_, eight) & useful; hits != 0; hits &= hits - 1)
      push(a, kWidth * node + static_cast<unsigned>(__builtin_ctz(hits)));
  }

  /// Returns a mask of eight boxes or triangles whose features can meet those of another one first.
  unsigned relevant(unsigned features, unsigned has_vertices, unsigned has_edges) const noexcept {
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
      transform_leaf(job_.a.leaves[box.child], box, job_.motion, slot);
      slot.leaf = box.child;
    }
    return slot;
  }

  void test_leaves(const TriangleBvh::Box& box_a, const TriangleBvh::Box& box_b) noexcept {
    const RelativeMotion& m = job_.motion;
    const MovedLeaf& a = moved(box_a);
    const TriangleBvh::Leaf& b = job_.b.leaves[box_b.child];
    Mask8 apart = disjoint_bounds(b.low, b.high, a.bounds_low, a.bounds_high);
    if (lane_mask(apart) == 255) return;
    apart |= clear_of_box(b.normal, b.offset, a.box, 0.0F);  // the box includes the margin
    if (lane_mask(apart) == 255) return;
    unsigned rows = (1U << box_a.count) - 1;
    rows &= ~lane_mask(disjoint_bounds(a.low, a.high, b.bounds_low, b.bounds_high));
    if (rows == 0) return;
    if (m.classify) {
      classify_leaves(box_a, a, b, rows & ~lane_mask(clear_of_box(a, at_rest(box_b), m.rounding, false)),
                      apart);
      return;
    }
    const unsigned b_vertices = features_of_eight(b.has_vertices, m.sides_b),
                   b_edges = features_of_eight(b.has_edges, m.sides_b);
    const float distance = (distance_bound(box_b, m.centre_B) + m.centre_travel) / m.radius;
    const float margin_of_plane = m.rounding + m.reach * (distance > 1.0F ? distance : 1.0F);
    for (rows &= ~lane_mask(clear_of_box(a, at_rest(box_b), margin_of_plane, m.moving)); rows != 0;
         rows &= rows - 1) {
      const int i = __builtin_ctz(rows);
      const TriangleBvh::Leaf& leaf_a = job_.a.leaves[box_a.child];
      const std::uint32_t ta = leaf_a.triangle[i];
      const unsigned features = ((features_of_eight(leaf_a.has_vertices, kSidesOfA) >> i) & 1U) |
                                (((features_of_eight(leaf_a.has_edges, kSidesOfA) >> i) & 1U) << 1);
      const unsigned useful = relevant(features, b_vertices, b_edges);
      if (useful == 0) continue;
      for (unsigned hits = near_triangles(a, i, b, apart, m.margin, margin_of_plane, m.moving) & useful;
           hits != 0; hits &= hits - 1) {
        if (job_.pair_count == job_.capacity) {
          job_.overflow = true;
          return;
        }
        job_.pairs[job_.pair_count++] = {ta, b.triangle[__builtin_ctz(hits)]};
      }
    }
  }

  void classify_leaves(const TriangleBvh::Box& box_a, const MovedLeaf& a, const TriangleBvh::Leaf& b,
                       unsigned rows, Mask8 apart) noexcept {
    const std::uint32_t* triangle_a = job_.a.leaves[box_a.child].triangle;
    for (; rows != 0; rows &= rows - 1) {
      const int i = __builtin_ctz(rows);
      const auto [overlap, in_doubt] = classify(a, i, b, apart, job_.motion.margin);
      if (job_.pair_count + job_.intersecting_count + kWidth > job_.capacity) {
        job_.overflow = true;
        return;
      }
      for (unsigned hits = overlap; hits != 0; hits &= hits - 1)
        job_.pairs[job_.capacity - ++job_.intersecting_count] = {triangle_a[i],
                                                                 b.triangle[__builtin_ctz(hits)]};
      for (unsigned hits = in_doubt; hits != 0; hits &= hits - 1)
        job_.pairs[job_.pair_count++] = {triangle_a[i], b.triangle[__builtin_ctz(hits)]};
    }
  }

  TraversalJob& job_;
  MovedLeaf* moved_;
  /// the last boxes transformed; consecutive visits often use the same one
  std::uint32_t swept_a_ = ~0U, swept_b_ = ~0U;
  SweptBox box_a_, box_b_;
};

}  // namespace

void WRENCHD_TRAVERSE(TraversalJob& job) noexcept {
  Traversal(job).run();
}

}  // namespace wrenchd::simd
