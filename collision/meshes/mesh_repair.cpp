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

namespace wrenchd {
namespace {

/// A triangle that is no higher than this has no area: in units of the mesh's size. Single precision leaves
/// such triangles where a corner was put on an edge, and makes up their normals.
constexpr double kThin = 1e-7;
/// A crack that single precision, or a text of seven digits, leaves between two faces is no wider: in units
/// of the largest coordinate.
constexpr double kCrack = 1e-6;
/// Each round takes out at least one layer of faces without area.
constexpr int kRounds = 20;
/// So many comparisons of shells are made at most; where it takes more the mesh is left as it is.
constexpr std::size_t kMostShellPairs = 10'000'000;

constexpr std::size_t kNone = ~std::size_t{0};

using Face = std::vector<std::size_t>;

std::size_t next(const Face& face, std::size_t i) noexcept {
  return i + 1 < face.size() ? i + 1 : 0;
}

/// Keeps the entries of a list that are marked.
template <class List>
void keep(List& list, const std::vector<bool>& kept) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < list.size(); ++i)
    if (kept[i]) {
      if (count < i) list[count] = std::move(list[i]);
      ++count;
    }
  list.resize(count);
}

/// The numbers in the file, written out before the first is taken away.
void number(std::vector<std::size_t>& numbers, std::size_t count) {
  if (!numbers.empty()) return;
  numbers.resize(count);
  std::iota(numbers.begin(), numbers.end(), std::size_t{0});
}

/// Points that are one. Those with the smallest index stand for the others.
class Merged {
 public:
  explicit Merged(std::size_t count) : into_(count) { std::iota(into_.begin(), into_.end(), std::size_t{0}); }

  std::size_t of(std::size_t v) const noexcept {
    while (into_[v] != v) v = into_[v];
    return v;
  }
  /// False where they were one already.
  bool merge(std::size_t a, std::size_t b) noexcept {
    a = of(a);
    b = of(b);
    into_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<std::size_t> into_;
};

/// 4 pi times how often the surface goes around a point: the sum of the solid angles of its triangles (Van
/// Oosterom and Strackee, 1983).
double solid_angle(const Vector3d& a, const Vector3d& b, const Vector3d& c) noexcept {
  const double A = a.norm(), B = b.norm(), C = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), A * B * C + a.dot(b) * C + b.dot(c) * A + c.dot(a) * B);
}

/// Connected faces, all of whose edges have two.
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
    leave_out_unused_points();
    merge_equal_points();
    tidy();
    close_cracks();
    turn_faces();
    drop_unused_points();
    return changes();
  }

 private:
  std::string face_name(std::size_t f) const { return "face " + std::to_string(soup_.face_in_file(f)); }
  std::string face_place(std::size_t f) const {
    const Face& face = soup_.faces[f];
    return face_name(f) + (face.empty() ? "" : " near " + format_point(soup_.vertices[face[0]]));
  }

  std::vector<std::string> changes() const;
  const std::vector<HalfEdge>& sides() {
    if (sides_.empty()) sides_ = half_edges_of(soup_);
    return sides_;
  }
  void keep_faces(const std::vector<bool>& kept) {
    sides_.clear();
    number(soup_.face_numbers, soup_.faces.size());
    keep(soup_.faces, kept);
    keep(soup_.face_numbers, kept);
  }
  void use(const Merged& merged) {
    sides_.clear();
    for (Face& face : soup_.faces)
      for (std::size_t& v : face) v = merged.of(v);
  }
  std::vector<bool> used_points() const;
  void leave_out_unused_points();
  void drop_unused_points();
  void merge_equal_points();
  void tidy();
  void drop_repeated_corners();
  bool fold_thin_faces();
  void drop_duplicate_faces();
  void close_cracks();
  void turn_faces();
  std::vector<Shell> shells(std::span<const HalfEdge> sides, std::vector<bool>& turned, bool& closed) const;
  bool holds(const Shell& shell, const std::vector<bool>& turned, const Vector3d& p) const;
  void turn_shells_out(std::vector<Shell>& shells, std::vector<bool>& turned) const;

  double thin(const Face& face, std::size_t& longest) const;

  PolygonSoup& soup_;
  Eigen::AlignedBox3d box_;
  std::vector<HalfEdge> sides_;  ///< empty: to be found again
  DefectCount unused_, merged_, repeated_, too_few_, duplicate_, thin_, joined_, turned_;
};

std::vector<std::string> Repair::changes() const {
  std::vector<std::string> out;
  unused_.report(out, "left out", "point", " that no face uses");
  merged_.report(out, "merged", "duplicate point", "");
  repeated_.report(out, "left out repeated corners of", "face", "");
  too_few_.report(out, "removed", "face", " with fewer than three different corners");
  duplicate_.report(out, "removed", "duplicate face", "");
  thin_.report(out, "removed", "face", " without area");
  joined_.report(out, "merged", "point", " along cracks no wider than single precision");
  turned_.report(out, "turned", "face", " round");
  return out;
}

std::vector<bool> Repair::used_points() const {
  std::vector<bool> used(soup_.vertices.size(), false);
  for (const Face& face : soup_.faces)
    for (const std::size_t v : face) used[v] = true;
  return used;
}

void Repair::leave_out_unused_points() {
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
  number(soup_.vertex_numbers, soup_.vertices.size());
  std::vector<std::size_t> index(used.size(), kNone);
  std::size_t count = 0;
  for (std::size_t v = 0; v < used.size(); ++v)
    if (used[v]) index[v] = count++;
  for (Face& face : soup_.faces)
    for (std::size_t& v : face) v = index[v];
  keep(soup_.vertices, used);
  keep(soup_.vertex_numbers, used);
}

void Repair::merge_equal_points() {
  std::vector<std::size_t> order(soup_.vertices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto& p = soup_.vertices;
  const auto before = [&](std::size_t a, std::size_t b) {
    return std::lexicographical_compare(p[a].data(), p[a].data() + 3, p[b].data(), p[b].data() + 3);
  };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return before(a, b) || (!before(b, a) && a < b); });
  Merged merged(order.size());
  std::vector<bool> duplicate(order.size(), false);
  for (std::size_t i = 1; i < order.size(); ++i)
    duplicate[order[i]] = p[order[i]] == p[order[i - 1]] && merged.merge(order[i - 1], order[i]);
  for (std::size_t v = 0; v < duplicate.size(); ++v)
    if (duplicate[v])
      merged_.add(
          [&] { return "vertex " + std::to_string(soup_.vertex_in_file(v)) + " at " + format_point(p[v]); });
  if (!merged_.any()) return;
  use(merged);
  drop_unused_points();
}

/// What merging points may leave behind, and what a file may have to begin with.
void Repair::tidy() {
  drop_repeated_corners();
  drop_duplicate_faces();
  bool folded = false;
  for (int round = 0; round < kRounds && fold_thin_faces(); ++round) {
    drop_repeated_corners();
    folded = true;
  }
  if (folded) drop_duplicate_faces();
}

void Repair::drop_repeated_corners() {
  std::vector<bool> kept(soup_.faces.size(), true);
  bool drops = false;
  for (std::size_t f = 0; f < soup_.faces.size(); ++f) {
    Face& face = soup_.faces[f];
    bool repeats = false;
    for (std::size_t i = 0; i < face.size(); ++i) repeats = repeats || face[i] == face[next(face, i)];
    if (!repeats && face.size() >= 3) continue;
    const std::string where = face_place(f);
    face.erase(std::unique(face.begin(), face.end()), face.end());
    if (face.size() > 1 && face.front() == face.back()) face.pop_back();
    kept[f] = face.size() >= 3;
    drops = drops || !kept[f];
    (kept[f] ? repeated_ : too_few_).add([&] { return where; });
    sides_.clear();
  }
  if (drops) keep_faces(kept);
}

/// The height of a triangle over its longest side, which begins at corner `longest`. Infinite for any other
/// polygon.
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

/// A needle is taken out by merging the ends of its shortest side. A cap, whose corner lies on its longest
/// side, goes with that corner to the face on the other side of it: the same surface, and no edge is left
/// open.
bool Repair::fold_thin_faces() {
  const double tolerance = kThin * box_.sizes().maxCoeff();
  struct Thin {
    std::size_t face, longest;
  };
  std::vector<Thin> list;
  std::vector<bool> kept(soup_.faces.size(), true);
  for (std::size_t f = 0, longest = 0; f < soup_.faces.size(); ++f)
    if (thin(soup_.faces[f], longest) <= tolerance) {
      list.push_back({f, longest});
      kept[f] = false;
    }
  if (list.empty()) return false;

  const std::vector<HalfEdge>& all_sides = sides();
  const auto faces_along = [&](std::size_t a, std::size_t b) {
    const auto [low, high] = std::minmax(a, b);
    return std::equal_range(all_sides.begin(), all_sides.end(), HalfEdge{{low, high}, 0, false},
                            [](const HalfEdge& x, const HalfEdge& y) { return x.edge < y.edge; });
  };
  Merged merged(soup_.vertices.size());
  bool changed = false;
  for (const auto& [f, longest] : list) {
    const Face& face = soup_.faces[f];
    const std::size_t a = face[longest], b = face[next(face, longest)], apex = face[(longest + 2) % 3];
    const auto& p = soup_.vertices;
    const std::size_t nearer = (p[a] - p[apex]).norm() < (p[b] - p[apex]).norm() ? a : b;
    const std::size_t thin_face = f;  // clang 14 captures no structured binding
    const auto told = [&] { thin_.add([&] { return face_place(thin_face); }); };
    if ((p[nearer] - p[apex]).norm() <= tolerance) {
      told();
      changed = true;
      merged.merge(nearer, apex);
      continue;
    }
    const auto [first, last] = faces_along(a, b);
    if (last - first != 2) {  // no neighbour whose side it could be
      told();
      changed = true;
      continue;
    }
    const std::size_t other = first->face == f ? (first + 1)->face : first->face;
    Face& neighbour = soup_.faces[other];
    const bool takes = kept[other] && std::find(neighbour.begin(), neighbour.end(), apex) == neighbour.end();
    std::size_t at = neighbour.size();
    for (std::size_t i = 0; i < neighbour.size() && takes; ++i) {
      const std::size_t from = neighbour[i], to = neighbour[next(neighbour, i)];
      if ((from == a && to == b) || (from == b && to == a)) at = i;
    }
    if (at == neighbour.size()) {
      kept[f] = true;  // another round, or nothing that can be told apart
      continue;
    }
    told();
    changed = true;
    neighbour.insert(neighbour.begin() + static_cast<std::ptrdiff_t>(at) + 1, apex);
  }
  if (!changed) return false;
  keep_faces(kept);
  use(merged);
  return true;
}

/// The same corners in the same order, from wherever and either way round.
Face canonical(const Face& face) {
  const auto least = std::min_element(face.begin(), face.end()) - face.begin();
  Face forward = face, backward(face.rbegin(), face.rend());
  std::rotate(forward.begin(), forward.begin() + least, forward.end());
  std::rotate(backward.begin(), backward.end() - least - 1, backward.end());
  return std::min(forward, backward);
}

void Repair::drop_duplicate_faces() {
  // They have edges of more than two faces, or of two that run the same way.
  std::vector<bool> suspect(soup_.faces.size(), false);
  for_each_edge(sides(), [&](std::span<const HalfEdge> sides) {
    if (sides.size() < 2 || (sides.size() == 2 && sides[0].forward != sides[1].forward)) return;
    for (const HalfEdge& side : sides) suspect[side.face] = true;
  });
  bool drops = false;
  std::map<Face, std::size_t> seen;
  std::vector<bool> kept(soup_.faces.size(), true);
  for (std::size_t f = 0; f < soup_.faces.size(); ++f) {
    if (!suspect[f]) continue;
    kept[f] = seen.emplace(canonical(soup_.faces[f]), f).second;
    if (kept[f]) continue;
    drops = true;
    duplicate_.add([&] { return face_place(f); });
  }
  if (drops) keep_faces(kept);
}

/// Only the ends of open edges are looked at: elsewhere nothing is wanting.
void Repair::close_cracks() {
  std::vector<std::size_t> border;
  for_each_edge(sides(), [&](std::span<const HalfEdge> sides) {
    if (sides.size() == 1) border.insert(border.end(), {sides[0].edge.first, sides[0].edge.second});
  });
  if (border.empty()) return;
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());

  double largest = 0.0;
  for (const Vector3d& p : soup_.vertices) largest = std::max(largest, p.lpNorm<Eigen::Infinity>());
  const double width = kCrack * largest;
  if (!(width > 0.0)) return;
  // Points within the width of each other lie in the same cell of a grid, or in cells side by side.
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
      const auto near_by = std::find_if(
          first, last, [&](const auto& other) { return (soup_.vertices[other.second] - p).norm() <= width; });
      found = near_by != last;
      if (!found) continue;
      merged.merge(v, near_by->second);
      joined_.add([&] { return format_point(p); });
    }
    if (!found) grid.emplace(c, v);
  }
  if (!joined_.any()) return;
  use(merged);
  tidy();
}

/// Spreads from face to face over edges that have two; `turned` receives the faces to turn so that neighbours
/// agree, the fewest of each shell. What has only one side is left as it is.
std::vector<Shell> Repair::shells(std::span<const HalfEdge> all_sides, std::vector<bool>& turned,
                                  bool& closed) const {
  struct Neighbour {
    std::size_t face;
    bool agrees;
  };
  std::vector<std::size_t> begin(soup_.faces.size() + 1, 0);
  const auto each_pair = [&](const auto& look) {
    for_each_edge(all_sides, [&](std::span<const HalfEdge> sides) {
      if (sides.size() == 2)
        look(sides[0], sides[1]);
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
    std::size_t against = 0;
    for (std::size_t i = 0; i < shell.faces.size(); ++i) {
      const std::size_t f = shell.faces[i];
      against += turned[f] ? 1 : 0;
      for (std::size_t k = begin[f]; k < begin[f + 1]; ++k) {
        const auto [g, agrees] = neighbours[k];
        const bool turn = turned[f] == agrees;
        if (reached[g]) {
          two_sided = two_sided && turned[g] == turn;
          continue;
        }
        reached[g] = true;
        turned[g] = turn;
        shell.faces.push_back(g);
      }
    }
    const bool most = 2 * against > shell.faces.size();
    for (const std::size_t f : shell.faces) turned[f] = two_sided && turned[f] != most;
    found.push_back(std::move(shell));
  }
  return found;
}

/// Is a point within a shell that is closed and consistent?
bool Repair::holds(const Shell& shell, const std::vector<bool>& turned, const Vector3d& p) const {
  if (!shell.box.contains(p)) return false;
  double angle = 0.0;
  for (const std::size_t f : shell.faces) {
    const Face& face = soup_.faces[f];
    const auto from_p = [&](std::size_t i) -> Vector3d { return soup_.vertices[face[i]] - p; };
    for (std::size_t i = 1; i + 1 < face.size(); ++i)
      angle += (turned[f] ? -1.0 : 1.0) * solid_angle(from_p(0), from_p(i), from_p(i + 1));
  }
  return std::abs(angle) > 2.0 * std::numbers::pi;
}

/// A shell in no other has its outer side outside, whatever the file says. What is in it, a cavity or not,
/// keeps its side with regard to it.
void Repair::turn_shells_out(std::vector<Shell>& all, std::vector<bool>& turned) const {
  const auto& p = soup_.vertices;
  const Vector3d middle = box_.center();
  for (Shell& shell : all)
    for (const std::size_t f : shell.faces) {
      const Face& face = soup_.faces[f];
      for (const std::size_t v : face) shell.box.extend(p[v]);
      for (std::size_t i = 1; i + 1 < face.size(); ++i)
        shell.volume += (turned[f] ? -1.0 : 1.0) *
                        (p[face[0]] - middle).dot((p[face[i]] - middle).cross(p[face[i + 1]] - middle));
    }
  const auto inwards = [](const Shell& shell) { return shell.volume < 0.0; };
  const auto count = static_cast<std::size_t>(std::count_if(all.begin(), all.end(), inwards));
  if (count * all.size() > kMostShellPairs) return;
  const std::vector<bool> as_found = turned;
  const auto within = [&](const Shell& inner, const Shell& outer) {
    return &inner != &outer && outer.box.contains(inner.box) &&
           holds(outer, as_found, p[soup_.faces[inner.faces[0]][0]]);
  };
  const auto turn = [&](const Shell& shell) {
    for (const std::size_t f : shell.faces) turned[f] = !turned[f];
  };
  for (const Shell& shell : all) {
    if (!inwards(shell)) continue;
    if (std::any_of(all.begin(), all.end(), [&](const Shell& other) { return within(shell, other); }))
      continue;
    turn(shell);
    for (const Shell& other : all)
      if (within(other, shell)) turn(other);
  }
}

void Repair::turn_faces() {
  std::vector<bool> turned(soup_.faces.size(), false);
  bool closed = true;
  std::vector<Shell> found = shells(sides(), turned, closed);
  if (closed) turn_shells_out(found, turned);
  for (std::size_t f = 0; f < turned.size(); ++f) {
    if (!turned[f]) continue;
    turned_.add([&] { return face_place(f); });
    std::reverse(soup_.faces[f].begin(), soup_.faces[f].end());
  }
}

}  // namespace

std::vector<std::string> repair(PolygonSoup& soup) {
  if (!find_invalid_values(soup).empty()) return {};
  return Repair(soup).all();
}

}  // namespace wrenchd
