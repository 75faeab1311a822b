// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_repair.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <numeric>
#include <span>
#include <unordered_map>

#include <Eigen/Geometry>

#include "collision/meshes/defect_count.hpp"
#include "collision/meshes/half_edges.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/point_numbers.hpp"

namespace wrenchd {
namespace {

/// A triangle has no area if its height is at most this, in units of the mesh's size. Single precision
/// creates such triangles where a corner was placed on an edge, and their normals are arbitrary.
constexpr double kMaxThinHeight = 1e-7;
/// Maximum width of a crack that rounding to single precision or to seven digits creates, in units of the
/// largest coordinate.
constexpr double kMaxCrackWidth = 1e-6;
/// Each round removes or shortens faces without area, so that rounds end by themselves. This limit only
/// bounds the time for a mesh that consists of little else.
constexpr int kMaxRounds = 500;
/// Maximum number of shell comparisons. If more are needed, the shells stay as they are.
constexpr std::size_t kMaxShellPairs = 10'000'000;

constexpr std::size_t kNone = ~std::size_t{0};

using Face = std::vector<std::size_t>;

std::size_t next(const Face& face, std::size_t i) noexcept {
  return i + 1 < face.size() ? i + 1 : 0;
}

/// Removes all entries of a list that are not marked.
template <class List>
void retain_marked(List& list, const std::vector<bool>& marked) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < list.size(); ++i)
    if (marked[i]) {
      if (count < i) list[count] = std::move(list[i]);
      ++count;
    }
  list.resize(count);
}

/// Writes the numbers in the file explicitly before the first removal.
void store_numbers(std::vector<std::size_t>& numbers, std::size_t count) {
  if (!numbers.empty()) return;
  numbers.resize(count);
  std::iota(numbers.begin(), numbers.end(), std::size_t{0});
}

/// Sets of merged points. The smallest index represents each set.
class Merged {
 public:
  explicit Merged(std::size_t count) : into_(count) { std::iota(into_.begin(), into_.end(), std::size_t{0}); }

  std::size_t of(std::size_t v) noexcept {
    while (into_[v] != v) v = into_[v] = into_[into_[v]];  // halves the path, so that chains stay short
    return v;
  }
  /// Returns false if the points were merged before.
  bool merge(std::size_t a, std::size_t b) noexcept {
    a = of(a);
    b = of(b);
    into_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<std::size_t> into_;
};

/// Returns the solid angle of a triangle (Van Oosterom and Strackee, 1983). The sum over a closed surface is
/// 4 pi times its winding number.
double solid_angle(const Vector3d& a, const Vector3d& b, const Vector3d& c) noexcept {
  const double A = a.norm(), B = b.norm(), C = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), A * B * C + a.dot(b) * C + b.dot(c) * A + c.dot(a) * B);
}

/// Connected faces. Each of their common edges has two faces.
struct Shell {
  std::vector<std::size_t> faces;
  Eigen::AlignedBox3d box;
  double volume = 0.0;
};

class Repair {
 public:
  explicit Repair(PolygonSoup& soup) : soup_(soup) {}

  std::vector<std::string> all() {
    for (const Vector3d& p : soup_.vertices) box_.extend(p);
    count_and_drop_unused_points();
    merge_equal_points();
    clean();
    close_cracks();
    orient_faces();
    drop_unused_points();
    split_joined_points();
    split_joined_edges();
    split_joined_points();  // an edge may have joined two fans
    return changes();
  }

 private:
  std::string face_name(std::size_t f) const { return "face " + std::to_string(soup_.face_in_file(f)); }
  std::string face_place(std::size_t f) const {
    const Face& face = soup_.faces[f];
    return face_name(f) + (face.empty() ? "" : " near " + format_point(soup_.vertices[face[0]]));
  }

  std::vector<std::string> changes() const;
  const std::vector<HalfEdge>& half_edges() {
    if (half_edges_.empty()) half_edges_ = half_edges_of(soup_);
    return half_edges_;
  }
  void keep_faces(const std::vector<bool>& marked) {
    half_edges_.clear();
    store_numbers(soup_.face_numbers, soup_.faces.size());
    retain_marked(soup_.faces, marked);
    retain_marked(soup_.face_numbers, marked);
  }
  void use(Merged& merged) {
    half_edges_.clear();
    for (Face& face : soup_.faces)
      for (std::size_t& v : face) v = merged.of(v);
  }
  std::vector<bool> used_points() const;
  void count_and_drop_unused_points();
  void drop_unused_points();
  void merge_equal_points();
  void clean();
  void drop_repeated_corners();
  struct ThinFace {
    std::size_t face, longest;  ///< number of the face, and the corner at which its longest side starts
  };
  void split_thin_polygons(double tolerance);
  void add_face(Face face, std::size_t like);
  bool merge_needles(const std::vector<ThinFace>& list, double tolerance);
  bool fold_caps(const std::vector<ThinFace>& list, double tolerance);
  bool fold_thin_faces();
  void drop_duplicate_faces();
  std::vector<std::pair<std::size_t, std::size_t>> pairs_to_remove(
      const std::vector<std::pair<std::size_t, std::size_t>>& pairs, const std::vector<bool>& marked);
  void close_cracks();
  void orient_faces();
  std::vector<Shell> shells(std::span<const HalfEdge> half_edges, std::vector<bool>& flipped,
                            bool& closed) const;
  bool contains_point(const Shell& shell, const std::vector<bool>& flipped, const Vector3d& p) const;
  void orient_shells_outwards(std::vector<Shell>& shells, std::vector<bool>& flipped) const;
  std::vector<std::pair<const HalfEdge*, const HalfEdge*>> pair_around_edge(
      std::span<const HalfEdge> half_edges) const;
  void split_joined_points();
  void split_joined_edges();

  double thin(const Face& face, std::size_t& longest) const;

  PolygonSoup& soup_;
  Eigen::AlignedBox3d box_;
  std::vector<HalfEdge> half_edges_;  ///< cached half-edges; empty: outdated
  DefectCount unused_, merged_, repeated_, too_few_, duplicate_, thin_, joined_, flipped_, split_;
};

std::vector<std::string> Repair::changes() const {
  std::vector<std::string> out;
  unused_.report(out, "removed", "point", " that no face uses");
  merged_.report(out, "merged", "duplicate point", "");
  repeated_.report(out, "removed repeated corners of", "face", "");
  too_few_.report(out, "removed", "face", " with fewer than three different corners");
  duplicate_.report(out, "removed", "duplicate face", "");
  thin_.report(out, "removed", "face", " without area");
  joined_.report(out, "merged", "point", " along cracks no wider than single precision");
  flipped_.report(out, "flipped", "face", "");
  split_.report(out, "split", "point", " at which parts of the surface are only joined");
  return out;
}

std::vector<bool> Repair::used_points() const {
  std::vector<bool> used(soup_.vertices.size(), false);
  for (const Face& face : soup_.faces)
    for (const std::size_t v : face) used[v] = true;
  return used;
}

void Repair::count_and_drop_unused_points() {
  const std::vector<bool> used = used_points();
  for (std::size_t v = 0; v < used.size(); ++v)
    if (!used[v])
      unused_.add([&] {
        return "vertex " + std::to_string(soup_.vertex_in_file(v)) + " at " + format_point(soup_.vertices[v]);
      });
  drop_unused_points();
}

void Repair::drop_unused_points() {
  const std::vector<bool> used = used_points();
  if (std::find(used.begin(), used.end(), false) == used.end()) return;
  half_edges_.clear();
  store_numbers(soup_.vertex_numbers, soup_.vertices.size());
  std::vector<std::size_t> index(used.size(), kNone);
  std::size_t count = 0;
  for (std::size_t v = 0; v < used.size(); ++v)
    if (used[v]) index[v] = count++;
  for (Face& face : soup_.faces)
    for (std::size_t& v : face) v = index[v];
  retain_marked(soup_.vertices, used);
  retain_marked(soup_.vertex_numbers, used);
}

void Repair::merge_equal_points() {
  const auto& p = soup_.vertices;
  Merged merged(p.size());
  PointNumbers numbers(p, p.size());
  for (std::size_t v = 0; v < p.size(); ++v) {
    const std::size_t first = numbers.find_or_add(p[v], v);
    if (first == v) continue;
    merged.merge(first, v);
    merged_.add(
        [&] { return "vertex " + std::to_string(soup_.vertex_in_file(v)) + " at " + format_point(p[v]); });
  }
  if (!merged_.any()) return;
  use(merged);
  drop_unused_points();
}

/// Removes the defects that merging creates and a file may contain.
void Repair::clean() {
  drop_repeated_corners();
  drop_duplicate_faces();
  bool folded = false;
  for (int round = 0; round < kMaxRounds && fold_thin_faces(); ++round) {
    drop_repeated_corners();
    folded = true;
  }
  if (folded) drop_duplicate_faces();
}

void Repair::drop_repeated_corners() {
  std::vector<bool> marked(soup_.faces.size(), true);
  bool drops = false;
  for (std::size_t f = 0; f < soup_.faces.size(); ++f) {
    Face& face = soup_.faces[f];
    bool repeats = false;
    for (std::size_t i = 0; i < face.size(); ++i) repeats = repeats || face[i] == face[next(face, i)];
    if (!repeats && face.size() >= 3) continue;
    const std::string where = face_place(f);
    face.erase(std::unique(face.begin(), face.end()), face.end());
    if (face.size() > 1 && face.front() == face.back()) face.pop_back();
    marked[f] = face.size() >= 3;
    drops = drops || !marked[f];
    (marked[f] ? repeated_ : too_few_).add([&] { return where; });
    half_edges_.clear();
  }
  if (drops) keep_faces(marked);
}

/// Returns the height of a triangle over its longest side, which starts at corner `longest`; infinity for
/// other polygons.
double Repair::thin(const Face& face, std::size_t& longest) const {
  if (face.size() != 3) return std::numeric_limits<double>::infinity();
  const auto& p = soup_.vertices;
  double longest_squared = -1.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double squared = (p[face[next(face, i)]] - p[face[i]]).squaredNorm();
    if (squared > longest_squared) {
      longest_squared = squared;
      longest = i;
    }
  }
  const double twice_area = (p[face[1]] - p[face[0]]).cross(p[face[2]] - p[face[0]]).norm();
  return longest_squared > 0.0 ? twice_area / std::sqrt(longest_squared) : 0.0;
}

/// Replaces a polygon whose corners lie on one line by triangles, which fold_thin_faces() removes.
void Repair::split_thin_polygons(double tolerance) {
  const auto& p = soup_.vertices;
  const std::size_t count = soup_.faces.size();
  for (std::size_t f = 0; f < count; ++f) {
    if (soup_.faces[f].size() < 4) continue;
    const Face face = soup_.faces[f];
    const auto from_first = [&](std::size_t v) -> Vector3d { return p[v] - p[face[0]]; };
    const std::size_t farthest =
        *std::max_element(face.begin(), face.end(), [&](std::size_t a, std::size_t b) {
          return from_first(a).squaredNorm() < from_first(b).squaredNorm();
        });
    const double length = from_first(farthest).norm();
    if (std::any_of(face.begin(), face.end(), [&](std::size_t v) {
          return from_first(v).cross(from_first(farthest)).norm() > tolerance * length;
        }))
      continue;
    soup_.faces[f].resize(3);
    for (std::size_t i = 2; i + 1 < face.size(); ++i) add_face({face[0], face[i], face[i + 1]}, f);
  }
}

/// Adds a face that has the same number in the file as face `like`.
void Repair::add_face(Face face, std::size_t like) {
  half_edges_.clear();
  store_numbers(soup_.face_numbers, soup_.faces.size());
  soup_.faces.push_back(std::move(face));
  soup_.face_numbers.push_back(soup_.face_numbers[like]);
}

/// Merges the ends of the shortest side of each needle. Returns false if there is no needle.
bool Repair::merge_needles(const std::vector<ThinFace>& list, double tolerance) {
  const auto& p = soup_.vertices;
  Merged merged(soup_.vertices.size());
  std::vector<bool> marked(soup_.faces.size(), true);
  bool changed = false;
  for (const auto& [f, longest] : list) {
    const Face& face = soup_.faces[f];
    const std::size_t a = face[longest], b = face[next(face, longest)], apex = face[(longest + 2) % 3];
    const std::size_t nearer = (p[a] - p[apex]).norm() < (p[b] - p[apex]).norm() ? a : b;
    if ((p[nearer] - p[apex]).norm() > tolerance) continue;
    const std::size_t face_number = f;  // clang 14 cannot capture structured bindings
    thin_.add([&] { return face_place(face_number); });
    changed = true;
    marked[f] = false;
    merged.merge(nearer, apex);
  }
  if (!changed) return false;
  keep_faces(marked);
  use(merged);
  return true;
}

/// A cap has a corner on its longest side. It is removed by inserting that corner into the face across that
/// side. If that face has the corner already, it falls into two. If that face is a cap as well, the two are
/// replaced by the two triangles across the other diagonal, which are shorter. So the surface stays equal and
/// no edge becomes open. A face that changed is not used again in the same round. Returns false if nothing
/// changed.
bool Repair::fold_caps(const std::vector<ThinFace>& list, double tolerance) {
  const std::vector<HalfEdge>& all_half_edges = half_edges();
  const auto faces_along = [&](std::size_t a, std::size_t b) {
    const auto [low, high] = std::minmax(a, b);
    return std::equal_range(all_half_edges.begin(), all_half_edges.end(), HalfEdge{{low, high}, 0, false},
                            [](const HalfEdge& x, const HalfEdge& y) { return x.edge < y.edge; });
  };
  const auto side_length = [&](const Face& face, std::size_t i) {
    return (soup_.vertices[face[next(face, i)]] - soup_.vertices[face[i]]).norm();
  };
  std::vector<bool> kept(soup_.faces.size(), true), used(soup_.faces.size(), false);
  std::vector<std::pair<Face, std::size_t>> added;
  bool changed = false;
  for (const auto& [f, longest] : list) {
    if (used[f]) continue;
    const Face face = soup_.faces[f];
    const std::size_t a = face[longest], b = face[next(face, longest)], apex = face[(longest + 2) % 3];
    const std::size_t face_number = f;  // clang 14 cannot capture structured bindings
    const auto remove = [&](std::size_t number) {
      kept[number] = false;
      used[number] = changed = true;
      thin_.add([&] { return face_place(number); });
    };
    const auto [first, last] = faces_along(a, b);
    const bool forward =
        std::find_if(first, last, [&](const HalfEdge& h) { return h.face == face_number; })->forward;
    const std::ptrdiff_t count = last - first;
    const auto across = std::find_if(first, last, [&](const HalfEdge& h) {
      return h.face != face_number && (h.forward != forward || count == 2);
    });
    // At a border no neighbour needs the corner. A face in excess of two at its edges closes nothing.
    const auto is_odd = [&](std::size_t u, std::size_t v) {
      const auto [from, to] = faces_along(u, v);
      return (to - from) % 2;
    };
    if (across == last || is_odd(a, b) + is_odd(b, apex) + is_odd(apex, a) >= 2) {
      remove(f);
      continue;
    }
    const std::size_t other = across->face;
    if (used[other]) continue;
    Face& neighbour = soup_.faces[other];
    std::size_t other_longest = 0;
    const bool other_is_thin = thin(neighbour, other_longest) <= tolerance;
    if (other_is_thin && side_length(neighbour, other_longest) > side_length(face, longest)) continue;
    std::size_t at = 0;  // the neighbour's side along the edge starts here
    while (at < neighbour.size() && !((neighbour[at] == a && neighbour[next(neighbour, at)] == b) ||
                                      (neighbour[at] == b && neighbour[next(neighbour, at)] == a)))
      ++at;
    if (at == neighbour.size()) continue;
    Face loop = neighbour;
    std::rotate(loop.begin(), loop.begin() + static_cast<std::ptrdiff_t>(next(neighbour, at)), loop.end());
    loop.push_back(apex);
    const auto twice = std::find(loop.begin(), loop.end() - 1, apex);
    std::vector<Face> parts;
    if (twice != loop.end() - 1) {
      parts = {Face(loop.begin(), twice + 1), Face(twice + 1, loop.end())};
    } else if (other_is_thin) {
      parts = {{loop[0], loop[1], apex}, {loop[1], loop[2], apex}};
    } else {
      parts = {loop};
    }
    std::erase_if(parts, [](const Face& part) { return part.size() < 3; });
    if (twice == loop.end() - 1 && other_is_thin) {  // as many faces as before, and shorter
      soup_.faces[f] = parts[0];
      neighbour = parts[1];
      used[f] = used[other] = changed = true;
      continue;
    }
    remove(f);
    used[other] = true;
    if (parts.empty()) {
      remove(other);
      continue;
    }
    neighbour = parts[0];
    if (parts.size() > 1) added.emplace_back(parts[1], other);
  }
  if (!changed) return false;
  half_edges_.clear();
  for (auto& [face, like] : added) add_face(std::move(face), like);
  kept.resize(soup_.faces.size(), true);
  keep_faces(kept);
  return true;
}

/// Returns false if there is no face without area, or if none of them can be removed.
bool Repair::fold_thin_faces() {
  const double tolerance = kMaxThinHeight * box_.sizes().maxCoeff();
  split_thin_polygons(tolerance);
  std::vector<ThinFace> list;
  for (std::size_t f = 0, longest = 0; f < soup_.faces.size(); ++f)
    if (thin(soup_.faces[f], longest) <= tolerance) list.push_back({f, longest});
  if (list.empty()) return false;
  return merge_needles(list, tolerance) || fold_caps(list, tolerance);
}

/// Returns the corners in an order that is independent of start and orientation.
Face canonical(const Face& face) {
  const auto least = std::min_element(face.begin(), face.end()) - face.begin();
  Face forward = face, backward(face.rbegin(), face.rend());
  std::rotate(forward.begin(), forward.begin() + least, forward.end());
  std::rotate(backward.begin(), backward.end() - least - 1, backward.end());
  return std::min(forward, backward);
}

/// Of several faces with the same corners and the same orientation one is kept. Two faces of opposite
/// orientation are the wall between two solids that touch, or a part of a surface that occurs twice. Both are
/// removed where removing one would leave edges with an odd number of faces.
void Repair::drop_duplicate_faces() {
  // Duplicate faces have an edge with more than two faces, or with two of the same direction.
  std::vector<bool> suspect(soup_.faces.size(), false);
  for_each_edge(half_edges(), [&](std::span<const HalfEdge> half_edges) {
    if (half_edges.size() < 2 || (half_edges.size() == 2 && half_edges[0].forward != half_edges[1].forward))
      return;
    for (const HalfEdge& half_edge : half_edges) suspect[half_edge.face] = true;
  });
  struct Known {
    std::size_t first, opposite = kNone;
  };
  const auto same_orientation = [&](std::size_t f, std::size_t g) {
    const Face &a = soup_.faces[f], &b = soup_.faces[g];
    const auto at = static_cast<std::size_t>(std::find(b.begin(), b.end(), a[0]) - b.begin());
    return b[next(b, at)] == a[1];
  };
  std::map<Face, Known> known;
  std::vector<bool> marked(soup_.faces.size(), true);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  bool drops = false;
  const auto drop = [&](std::size_t f) {
    marked[f] = false;
    drops = true;
    duplicate_.add([&] { return face_place(f); });
  };
  for (std::size_t f = 0; f < soup_.faces.size(); ++f) {
    if (!suspect[f]) continue;
    const auto [at, is_new] = known.try_emplace(canonical(soup_.faces[f]), Known{f});
    if (is_new) continue;
    Known& faces = at->second;
    if (faces.opposite == kNone && !same_orientation(faces.first, f)) {
      faces.opposite = f;
      pairs.emplace_back(faces.first, f);
    } else {
      drop(f);
    }
  }
  for (const auto& [f, g] : pairs_to_remove(pairs, marked)) drop(f);
  for (const auto& [f, g] : pairs)
    if (marked[g]) drop(g);
  if (drops) keep_faces(marked);
}

/// Returns the pairs of opposite faces of which both must go. Pairs that share an edge are decided together.
/// marked: the faces that remain if the pairs remain.
std::vector<std::pair<std::size_t, std::size_t>> Repair::pairs_to_remove(
    const std::vector<std::pair<std::size_t, std::size_t>>& pairs, const std::vector<bool>& marked) {
  if (pairs.empty()) return {};
  std::vector<std::size_t> pair_of(soup_.faces.size(), kNone);
  for (std::size_t i = 0; i < pairs.size(); ++i) pair_of[pairs[i].first] = pair_of[pairs[i].second] = i;
  Merged patch(pairs.size());
  const auto each_edge = [&](const auto& use) {
    std::vector<std::size_t> here;
    for_each_edge(half_edges(), [&](std::span<const HalfEdge> at_edge) {
      here.clear();
      std::size_t faces = 0;
      for (const HalfEdge& half_edge : at_edge) {
        if (!marked[half_edge.face]) continue;
        ++faces;
        if (pair_of[half_edge.face] != kNone) here.push_back(pair_of[half_edge.face]);
      }
      if (!here.empty()) use(here, faces);
    });
  };
  each_edge([&](const std::vector<std::size_t>& here, std::size_t) {
    for (const std::size_t pair : here) patch.merge(here[0], pair);
  });
  // Number of odd edges that are left if one face of each pair goes, minus the number if both go.
  std::vector<std::ptrdiff_t> odd(pairs.size(), 0);
  each_edge([&](const std::vector<std::size_t>& here, std::size_t faces) {
    const auto one_goes = static_cast<std::ptrdiff_t>((faces - here.size() / 2) % 2);
    const auto both_go = static_cast<std::ptrdiff_t>((faces - here.size()) % 2);
    odd[patch.of(here[0])] += one_goes - both_go;
  });
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (odd[patch.of(i)] > 0) out.push_back(pairs[i]);
  return out;
}

/// Tests the ends of open edges only.
void Repair::close_cracks() {
  std::vector<std::size_t> border;
  for_each_edge(half_edges(), [&](std::span<const HalfEdge> half_edges) {
    if (half_edges.size() == 1)
      border.insert(border.end(), {half_edges[0].edge.first, half_edges[0].edge.second});
  });
  if (border.empty()) return;
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());

  double largest = 0.0;
  for (const Vector3d& p : soup_.vertices) largest = std::max(largest, p.lpNorm<Eigen::Infinity>());
  const double width = kMaxCrackWidth * largest;
  if (!(width > 0.0)) return;
  // Points within the width of each other lie in the same grid cell or in adjacent cells.
  const auto cell = [&](const Vector3d& p) -> std::array<std::int64_t, 3> {
    const Vector3d at = (p / width).array().floor();
    return {static_cast<std::int64_t>(at.x()), static_cast<std::int64_t>(at.y()),
            static_cast<std::int64_t>(at.z())};
  };
  const auto hash = [](const std::array<std::int64_t, 3>& c) {
    std::uint64_t h = 0;
    for (const std::int64_t x : c) h = (h ^ static_cast<std::uint64_t>(x)) * 0x9e3779b97f4a7c15U;
    return static_cast<std::size_t>(h ^ h >> 32);
  };
  std::unordered_multimap<std::array<std::int64_t, 3>, std::size_t, decltype(hash)> grid(border.size(), hash);
  Merged merged(soup_.vertices.size());
  for (const std::size_t v : border) {
    const Vector3d& p = soup_.vertices[v];
    const auto c = cell(p);
    bool found = false;
    for (int i = 0; i < 27 && !found; ++i) {
      const auto [first, last] = grid.equal_range({c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1});
      const auto nearby = std::find_if(
          first, last, [&](const auto& other) { return (soup_.vertices[other.second] - p).norm() <= width; });
      found = nearby != last;
      if (!found) continue;
      merged.merge(v, nearby->second);
      joined_.add([&] { return format_point(p); });
    }
    if (!found) grid.emplace(c, v);
  }
  if (!joined_.any()) return;
  use(merged);
  clean();
}

/// Collects shells across edges with two faces. `flipped` receives the smallest set of faces whose reversal
/// makes each shell consistent. A one-sided shell stays as it is.
std::vector<Shell> Repair::shells(std::span<const HalfEdge> all_half_edges, std::vector<bool>& flipped,
                                  bool& closed) const {
  struct Neighbour {
    std::size_t face;
    bool agrees;
  };
  std::vector<std::size_t> begin(soup_.faces.size() + 1, 0);
  const auto each_pair = [&](const auto& use) {
    for_each_edge(all_half_edges, [&](std::span<const HalfEdge> half_edges) {
      if (half_edges.size() == 2)
        use(half_edges[0], half_edges[1]);
      else
        closed = false;
    });
  };
  closed = true;
  each_pair([&](const HalfEdge& a, const HalfEdge& b) {
    ++begin[a.face + 1];
    ++begin[b.face + 1];
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Neighbour> neighbours(begin.back());
  std::vector<std::size_t> at(begin.begin(), begin.end() - 1);
  each_pair([&](const HalfEdge& a, const HalfEdge& b) {
    const bool agrees = a.forward != b.forward;
    neighbours[at[a.face]++] = {b.face, agrees};
    neighbours[at[b.face]++] = {a.face, agrees};
  });

  std::vector<Shell> found;
  std::vector<bool> reached(soup_.faces.size(), false);
  for (std::size_t seed = 0; seed < soup_.faces.size(); ++seed) {
    if (reached[seed]) continue;
    Shell shell;
    shell.faces = {seed};
    reached[seed] = true;
    bool two_sided = true;
    std::size_t flipped_count = 0;
    for (std::size_t i = 0; i < shell.faces.size(); ++i) {
      const std::size_t f = shell.faces[i];
      flipped_count += flipped[f] ? 1 : 0;
      for (std::size_t k = begin[f]; k < begin[f + 1]; ++k) {
        const auto [g, agrees] = neighbours[k];
        const bool flip = flipped[f] == agrees;
        if (reached[g]) {
          two_sided = two_sided && flipped[g] == flip;
          continue;
        }
        reached[g] = true;
        flipped[g] = flip;
        shell.faces.push_back(g);
      }
    }
    const bool majority_flipped = 2 * flipped_count > shell.faces.size();
    for (const std::size_t f : shell.faces) flipped[f] = two_sided && flipped[f] != majority_flipped;
    found.push_back(std::move(shell));
  }
  return found;
}

/// Returns true if a point lies inside a closed, consistent shell.
bool Repair::contains_point(const Shell& shell, const std::vector<bool>& flipped, const Vector3d& p) const {
  if (!shell.box.contains(p)) return false;
  double angle = 0.0;
  for (const std::size_t f : shell.faces) {
    const Face& face = soup_.faces[f];
    const auto from_p = [&](std::size_t i) -> Vector3d { return soup_.vertices[face[i]] - p; };
    for (std::size_t i = 1; i + 1 < face.size(); ++i)
      angle += (flipped[f] ? -1.0 : 1.0) * solid_angle(from_p(0), from_p(i), from_p(i + 1));
  }
  return std::abs(angle) > 2.0 * std::numbers::pi;
}

/// Makes every outermost shell face outwards. Shells inside it keep their orientation relative to it.
void Repair::orient_shells_outwards(std::vector<Shell>& all, std::vector<bool>& flipped) const {
  const auto& p = soup_.vertices;
  const Vector3d middle = box_.center();
  for (Shell& shell : all)
    for (const std::size_t f : shell.faces) {
      const Face& face = soup_.faces[f];
      for (const std::size_t v : face) shell.box.extend(p[v]);
      for (std::size_t i = 1; i + 1 < face.size(); ++i)
        shell.volume += (flipped[f] ? -1.0 : 1.0) *
                        (p[face[0]] - middle).dot((p[face[i]] - middle).cross(p[face[i + 1]] - middle));
    }
  const auto inwards = [](const Shell& shell) { return shell.volume < 0.0; };
  const auto count = static_cast<std::size_t>(std::count_if(all.begin(), all.end(), inwards));
  if (count * all.size() > kMaxShellPairs) return;
  const std::vector<bool> as_found = flipped;
  const auto within = [&](const Shell& inner, const Shell& outer) {
    return &inner != &outer && outer.box.contains(inner.box) &&
           contains_point(outer, as_found, p[soup_.faces[inner.faces[0]][0]]);
  };
  const auto flip = [&](const Shell& shell) {
    for (const std::size_t f : shell.faces) flipped[f] = !flipped[f];
  };
  for (const Shell& shell : all) {
    if (!inwards(shell)) continue;
    if (std::any_of(all.begin(), all.end(), [&](const Shell& other) { return within(shell, other); }))
      continue;
    flip(shell);
    for (const Shell& other : all)
      if (within(other, shell)) flip(other);
  }
}

void Repair::orient_faces() {
  std::vector<bool> flipped(soup_.faces.size(), false);
  bool closed = true;
  std::vector<Shell> found = shells(half_edges(), flipped, closed);
  if (closed) orient_shells_outwards(found, flipped);
  for (std::size_t f = 0; f < flipped.size(); ++f) {
    if (!flipped[f]) continue;
    flipped_.add([&] { return face_place(f); });
    std::reverse(soup_.faces[f].begin(), soup_.faces[f].end());
  }
  if (flipped_.any()) half_edges_.clear();
}

/// Pairs the faces around an edge so that each pair bounds a wedge of the solid. Returns no pair if the faces
/// do not enclose wedges: if one direction is more frequent than the other.
std::vector<std::pair<const HalfEdge*, const HalfEdge*>> Repair::pair_around_edge(
    std::span<const HalfEdge> half_edges) const {
  const auto& p = soup_.vertices;
  const Vector3d along = p[half_edges[0].edge.second] - p[half_edges[0].edge.first];
  const Vector3d x = along.unitOrthogonal(), y = along.normalized().cross(x);
  struct Wing {
    std::int64_t angle;  ///< rounded, so that equal angles are equal
    const HalfEdge* half_edge;
  };
  std::vector<Wing> wings;
  for (const HalfEdge& half_edge : half_edges) {
    const Face& face = soup_.faces[half_edge.face];
    Vector3d normal = Vector3d::Zero();
    for (std::size_t i = 1; i + 1 < face.size(); ++i)
      normal += (p[face[i]] - p[face[0]]).cross(p[face[i + 1]] - p[face[0]]);
    const Vector3d into = normal.cross(half_edge.forward ? along : Vector3d(-along));  // into the face
    wings.push_back({std::llround(1e9 * std::atan2(into.dot(y), into.dot(x))), &half_edge});
  }
  // A forward face has the solid before it, in the sense of increasing angle, and a backward face behind it.
  // So each pair is a backward face and the forward face that closes its wedge. Of two faces at one angle the
  // forward one comes first.
  std::sort(wings.begin(), wings.end(), [](const Wing& a, const Wing& b) {
    return std::pair(a.angle, !a.half_edge->forward) < std::pair(b.angle, !b.half_edge->forward);
  });
  std::vector<std::pair<const HalfEdge*, const HalfEdge*>> pairs;
  std::vector<const HalfEdge*> open;
  for (std::size_t i = 0; i < 2 * wings.size(); ++i) {  // twice around, because the first wedge may be open
    const HalfEdge* const half_edge = wings[i % wings.size()].half_edge;
    const bool second_round = i >= wings.size();
    if (!half_edge->forward) {
      if (!second_round) open.push_back(half_edge);
    } else if (!open.empty() && std::none_of(pairs.begin(), pairs.end(),
                                             [&](const auto& pair) { return pair.second == half_edge; })) {
      pairs.emplace_back(open.back(), half_edge);
      open.pop_back();
    }
  }
  if (2 * pairs.size() != wings.size()) pairs.clear();
  return pairs;
}

/// Parts of a surface that are joined only in a point or in an edge receive points of their own. There the
/// parts then touch each other. Corners of faces that are connected across edges keep a common point.
void Repair::split_joined_points() {
  std::vector<std::size_t> begin(soup_.faces.size() + 1, 0);
  for (std::size_t f = 0; f < soup_.faces.size(); ++f) begin[f + 1] = begin[f] + soup_.faces[f].size();
  Merged fan(begin.back());  // corners of faces
  const auto corner = [&](const HalfEdge& half_edge, bool at_low) {
    const Face& face = soup_.faces[half_edge.face];
    const std::size_t from = half_edge.forward ? half_edge.edge.first : half_edge.edge.second;
    const std::size_t to = half_edge.forward ? half_edge.edge.second : half_edge.edge.first;
    std::size_t i = 0;
    while (face[i] != from || face[next(face, i)] != to) ++i;
    return begin[half_edge.face] + (at_low == half_edge.forward ? i : next(face, i));
  };
  const auto connect = [&](const HalfEdge& a, const HalfEdge& b) {
    for (const bool at_low : {true, false}) fan.merge(corner(a, at_low), corner(b, at_low));
  };
  for_each_edge(half_edges(), [&](std::span<const HalfEdge> at_edge) {
    if (at_edge.size() == 2) return connect(at_edge[0], at_edge[1]);
    if (at_edge.size() < 2) return;
    const auto pairs = pair_around_edge(at_edge);
    for (const auto& [a, b] : pairs) connect(*a, *b);
    if (pairs.empty())
      for (const HalfEdge& half_edge : at_edge) connect(at_edge[0], half_edge);
  });
  std::vector<std::size_t> fan_of_point(soup_.vertices.size(), kNone);
  std::unordered_map<std::size_t, std::size_t> own_point;  // of further fans
  for (std::size_t f = 0; f < soup_.faces.size(); ++f)
    for (std::size_t i = 0; i < soup_.faces[f].size(); ++i) {
      std::size_t& v = soup_.faces[f][i];
      const std::size_t this_fan = fan.of(begin[f] + i);
      if (fan_of_point[v] == kNone) fan_of_point[v] = this_fan;
      if (fan_of_point[v] == this_fan) continue;
      const auto [own, is_new] = own_point.try_emplace(this_fan, soup_.vertices.size());
      if (is_new) {
        split_.add([&] {
          return "vertex " + std::to_string(soup_.vertex_in_file(v)) + " at " +
                 format_point(soup_.vertices[v]);
        });
        store_numbers(soup_.vertex_numbers, soup_.vertices.size());
        soup_.vertices.push_back(Vector3d(soup_.vertices[v]));
        soup_.vertex_numbers.push_back(soup_.vertex_numbers[v]);
      }
      v = own->second;
    }
  if (split_.any()) half_edges_.clear();
}

/// If the faces at an edge are connected around both of its ends, no end can be split. Then each pair of
/// faces but the first receives a point of its own in the middle of the edge.
void Repair::split_joined_edges() {
  std::vector<std::pair<HalfEdge, HalfEdge>> further;
  for_each_edge(half_edges(), [&](std::span<const HalfEdge> at_edge) {
    if (at_edge.size() <= 2) return;
    const auto pairs = pair_around_edge(at_edge);
    for (std::size_t i = 1; i < pairs.size(); ++i) further.emplace_back(*pairs[i].first, *pairs[i].second);
  });
  if (further.empty()) return;
  half_edges_.clear();
  store_numbers(soup_.vertex_numbers, soup_.vertices.size());
  for (const auto& [a, b] : further) {
    const std::size_t middle = soup_.vertices.size();
    const Vector3d p = 0.5 * (soup_.vertices[a.edge.first] + soup_.vertices[a.edge.second]);
    split_.add([&] { return "the edge at " + format_point(p); });
    soup_.vertices.push_back(p);
    soup_.vertex_numbers.push_back(soup_.vertex_numbers[a.edge.first]);
    for (const HalfEdge& half_edge : {a, b}) {
      Face& face = soup_.faces[half_edge.face];
      const std::size_t from = half_edge.forward ? half_edge.edge.first : half_edge.edge.second;
      const std::size_t to = half_edge.forward ? half_edge.edge.second : half_edge.edge.first;
      std::size_t i = 0;
      while (face[i] != from || face[next(face, i)] != to) ++i;
      face.insert(face.begin() + static_cast<std::ptrdiff_t>(i) + 1, middle);
    }
  }
}

}  // namespace

std::vector<std::string> repair(PolygonSoup& soup) {
  if (!find_invalid_values(soup).empty()) return {};
  return Repair(soup).all();
}

}  // namespace wrenchd
