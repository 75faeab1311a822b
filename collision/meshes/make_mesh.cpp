// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/make_mesh.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <ostream>
#include <random>
#include <stdexcept>

namespace wrenchd {
namespace {

constexpr double kFullTurn_rad = 2.0 * std::numbers::pi;

std::uint32_t at_least(double request, std::uint32_t least) {
  return std::max(least, static_cast<std::uint32_t>(std::lround(request)));
}

/// Assigns one index to equal points.
class Welder {
 public:
  explicit Welder(TriangleMesh& mesh, double grain) : mesh_(mesh), grain_(grain) {}

  std::uint32_t operator()(const Vector3d& p) {
    const std::array<long long, 3> key = {std::llround(p.x() / grain_), std::llround(p.y() / grain_),
                                          std::llround(p.z() / grain_)};
    const auto [found, is_new] =
        numbers_.try_emplace(key, static_cast<std::uint32_t>(mesh_.vertices_m.size()));
    if (is_new) mesh_.vertices_m.push_back(p);
    return found->second;
  }

 private:
  TriangleMesh& mesh_;
  double grain_;
  std::map<std::array<long long, 3>, std::uint32_t> numbers_;
};

/// Returns the unit sphere: an icosahedron whose 20 faces are divided into f^2 triangles each.
TriangleMesh geodesic(std::uint32_t f) {
  const double g = std::numbers::phi;
  const std::array<Vector3d, 12> corners = {{{-1, g, 0},
                                             {1, g, 0},
                                             {-1, -g, 0},
                                             {1, -g, 0},
                                             {0, -1, g},
                                             {0, 1, g},
                                             {0, -1, -g},
                                             {0, 1, -g},
                                             {g, 0, -1},
                                             {g, 0, 1},
                                             {-g, 0, -1},
                                             {-g, 0, 1}}};
  constexpr std::size_t kFaces[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                         {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                         {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                         {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  TriangleMesh mesh;
  Welder weld(mesh, 1e-7);
  for (const auto& face : kFaces) {
    const Vector3d& a = corners[face[0]];
    const Vector3d& b = corners[face[1]];
    const Vector3d& c = corners[face[2]];
    const auto at = [&](std::uint32_t i, std::uint32_t j) {
      const double u = static_cast<double>(i) / f, v = static_cast<double>(j) / f;
      return weld(((1.0 - u - v) * a + u * b + v * c).normalized());
    };
    for (std::uint32_t i = 0; i < f; ++i)
      for (std::uint32_t j = 0; i + j < f; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < f) mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  return mesh;
}

/// Returns a sphere with smooth bumps: sums of sines with seeded directions and phases.
TriangleMesh bumpy(const GeneratedMesh& request, double radius_m, double height) {
  struct Wave {
    Vector3d k;
    double amplitude, phase;
  };
  std::mt19937 generator(request.seed);
  // The distributions of the standard library differ between implementations, its generators do not.
  const auto uniform = [&] { return (static_cast<double>(generator()) + 0.5) / 4294967296.0; };
  const auto normal = [&] {
    return std::sqrt(-2.0 * std::log(uniform())) * std::cos(kFullTurn_rad * uniform());
  };
  std::vector<Wave> waves;
  for (int i = 0; i < 24; ++i) {
    const double x = normal(), y = normal(), z = normal();
    waves.push_back(
        {(3.0 + i) * Vector3d(x, y, z).normalized(), height / (1.0 + 0.25 * i), kFullTurn_rad * uniform()});
  }
  TriangleMesh mesh = geodesic(at_least(std::sqrt(static_cast<double>(request.triangles) / 20.0), 1));
  for (Vector3d& p : mesh.vertices_m) {
    double scale = 1.0;
    for (const auto& [k, amplitude, phase] : waves) scale += amplitude * std::sin(k.dot(p) + phase);
    p *= radius_m * scale;
  }
  return mesh;
}

/// Returns a box whose sides are divided into nearly square cells of two triangles each.
TriangleMesh box(const GeneratedMesh& request, const Vector3d& size_m) {
  const double area = 2.0 * (size_m.x() * size_m.y() + size_m.y() * size_m.z() + size_m.z() * size_m.x());
  const double cell_m = std::sqrt(2.0 * area / static_cast<double>(request.triangles));
  std::array<std::uint32_t, 3> cells{};
  for (int d = 0; d < 3; ++d) cells[static_cast<std::size_t>(d)] = at_least(size_m[d] / cell_m, 1);
  TriangleMesh mesh;
  Welder weld(mesh, 1e-9);
  for (int d = 0; d < 3; ++d)
    for (const int side : {-1, 1}) {
      const int e = (d + 1) % 3, f = (d + 2) % 3;
      const std::uint32_t ne = cells[static_cast<std::size_t>(e)], nf = cells[static_cast<std::size_t>(f)];
      const auto at = [&](std::uint32_t i, std::uint32_t j) {
        Vector3d p;
        p[d] = 0.5 * side * size_m[d];
        p[e] = size_m[e] * (static_cast<double>(i) / ne - 0.5);
        p[f] = size_m[f] * (static_cast<double>(j) / nf - 0.5);
        return weld(p);
      };
      for (std::uint32_t i = 0; i < ne; ++i)
        for (std::uint32_t j = 0; j < nf; ++j) {
          std::array<std::uint32_t, 4> quad = {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
          if (side < 0) std::swap(quad[1], quad[3]);
          mesh.triangles.push_back({quad[0], quad[1], quad[2]});
          mesh.triangles.push_back({quad[0], quad[2], quad[3]});
        }
    }
  return mesh;
}

/// A closed curve around the z axis at one height.
struct Ring {
  double z_m;
  std::function<double(double angle)> radius_m;
};

/// Returns the solid between rings: the outer rings from low to high, and the rings of the bore, if any. Two
/// rings may have the same height if their radii differ everywhere.
TriangleMesh lathe(const std::vector<double>& angles, const std::vector<Ring>& outside,
                   const std::vector<Ring>& bore) {
  TriangleMesh mesh;
  const auto around = static_cast<std::uint32_t>(angles.size());
  const auto number = [&] { return static_cast<std::uint32_t>(mesh.vertices_m.size()); };
  const auto strip = [&](std::uint32_t low, std::uint32_t high) {
    for (std::uint32_t i = 0; i < around; ++i) {
      const std::uint32_t j = (i + 1) % around;
      mesh.triangles.push_back({low + i, low + j, high + j});
      mesh.triangles.push_back({low + i, high + j, high + i});
    }
  };
  const auto points = [&](const std::vector<Ring>& rings) {
    std::vector<std::uint32_t> first;
    for (const Ring& ring : rings) {
      first.push_back(number());
      for (const double angle : angles) {
        const double r = ring.radius_m(angle);
        mesh.vertices_m.emplace_back(r * std::cos(angle), r * std::sin(angle), ring.z_m);
      }
    }
    return first;
  };
  const std::vector<std::uint32_t> outer = points(outside);
  for (std::size_t k = 0; k + 1 < outer.size(); ++k) strip(outer[k], outer[k + 1]);
  if (!bore.empty()) {
    const std::vector<std::uint32_t> inner = points(bore);
    for (std::size_t k = 0; k + 1 < inner.size(); ++k) strip(inner[k + 1], inner[k]);
    strip(outer.back(), inner.back());
    strip(inner.front(), outer.front());
    return mesh;
  }
  const std::uint32_t low = number();
  mesh.vertices_m.emplace_back(0, 0, outside.front().z_m);
  mesh.vertices_m.emplace_back(0, 0, outside.back().z_m);
  for (std::uint32_t i = 0; i < around; ++i) {
    const std::uint32_t j = (i + 1) % around;
    mesh.triangles.push_back({low, outer.front() + j, outer.front() + i});
    mesh.triangles.push_back({low + 1, outer.back() + i, outer.back() + j});
  }
  return mesh;
}

std::vector<double> even_angles(std::uint32_t around) {
  std::vector<double> angles;
  for (std::uint32_t i = 0; i < around; ++i) angles.push_back(kFullTurn_rad * i / around);
  return angles;
}

/// A body of revolution or of constant profile along z, closed at both ends.
struct Revolved {
  double length_m;
  std::function<double(double angle, double z_m)> radius_m;
  std::function<double(double angle, double z_m)> bore_m;  ///< empty: no bore
  std::uint32_t around, along;
};

TriangleMesh revolve(const Revolved& body) {
  const auto rings = [&](const auto& radius_m) {
    std::vector<Ring> out;
    for (std::uint32_t k = 0; radius_m && k <= body.along; ++k) {
      const double z = body.length_m * (static_cast<double>(k) / body.along - 0.5);
      out.push_back({z, [&radius_m, z](double angle) { return radius_m(angle, z); }});
    }
    return out;
  };
  return lathe(even_angles(body.around), rings(body.radius_m), rings(body.bore_m));
}

/// Chooses the cell counts around and along the axis so that the cells are nearly square and the triangle
/// count is as requested.
Revolved cell_grid(const GeneratedMesh& request, double length_m, double radius_m, int sheets) {
  const double cells = static_cast<double>(request.triangles) / (2.0 * sheets);
  const double around = std::sqrt(cells * kFullTurn_rad * radius_m / length_m);
  return {length_m, {}, {}, at_least(around, 8), at_least(cells / around, 1)};
}

TriangleMesh peg(const GeneratedMesh& request) {
  Revolved body = cell_grid(request, 0.060, 0.0098, 1);
  body.radius_m = [](double angle, double z) {
    return 0.0098 + 0.00002 * std::sin(5.0 * angle) * std::sin(25.0 * z / 0.060);
  };
  return revolve(body);
}

TriangleMesh hole(const GeneratedMesh& request) {
  Revolved body = cell_grid(request, 0.080, 0.0130, 2);
  body.radius_m = [](double, double) { return 0.020; };
  body.bore_m = [](double angle, double z) {
    return 0.0100 + 0.00002 * std::sin(5.0 * angle) * std::sin(25.0 * z / 0.080);
  };
  return revolve(body);
}

/// A triangle wave of period 1: 0 to 1 to 0.
double triangle_wave(double phase) {
  const double x = phase - std::floor(phase);
  return x < 0.5 ? 2.0 * x : 2.0 - 2.0 * x;
}

constexpr double kPitch_m = 0.0015;
constexpr double kThread_m = 0.0008;

double thread(double angle, double z) {
  return kThread_m * triangle_wave(z / kPitch_m - angle / kFullTurn_rad);
}

TriangleMesh bolt(const GeneratedMesh& request) {
  Revolved body = cell_grid(request, 0.030, 0.005, 1);
  body.radius_m = [](double angle, double z) { return 0.0041 + thread(angle, z); };
  return revolve(body);
}

TriangleMesh nut(const GeneratedMesh& request) {
  Revolved body = cell_grid(request, 0.008, 0.0067, 2);
  body.around = (body.around + 5) / 6 * 6;  // a multiple of six corners
  body.radius_m = [](double angle, double) {
    const double sixth = kFullTurn_rad / 6.0;
    const double off = angle - sixth * std::floor(angle / sixth) - 0.5 * sixth;
    return 0.0085 / std::cos(off);
  };
  body.bore_m = [](double angle, double z) { return 0.0042 + thread(angle, z); };
  return revolve(body);
}

TriangleMesh gear(const GeneratedMesh& request) {
  constexpr double kTeeth = 20.0;
  Revolved body = cell_grid(request, 0.010, 0.021, 2);
  body.radius_m = [](double angle, double) {
    return 0.019 + 0.004 * std::clamp(2.4 * triangle_wave(kTeeth * angle / kFullTurn_rad) - 0.7, 0.0, 1.0);
  };
  body.bore_m = [](double, double) { return 0.006; };
  return revolve(body);
}

/// Returns a circle at one height.
Ring circle(double z_m, double radius_m) {
  return {z_m, [radius_m](double) { return radius_m; }};
}

/// Returns the number of vertices per ring that yields about the requested number of triangles.
std::uint32_t around_for(const GeneratedMesh& request, std::size_t rings) {
  return at_least(static_cast<double>(request.triangles) / (2.0 * static_cast<double>(rings)), 8);
}

TriangleMesh dowel(const GeneratedMesh& request) {
  const std::vector<Ring> rings = {circle(-0.030, 0.0079), circle(-0.028, 0.0099), circle(0.028, 0.0099),
                                   circle(0.030, 0.0079)};
  return lathe(even_angles(around_for(request, rings.size())), rings, {});
}

TriangleMesh socket(const GeneratedMesh& request) {
  const std::vector<Ring> outside = {circle(-0.025, 0.020), circle(0.025, 0.020)};
  const std::vector<Ring> bore = {circle(-0.025, 0.010), circle(0.022, 0.010), circle(0.025, 0.013)};
  return lathe(even_angles(around_for(request, outside.size() + bore.size())), outside, bore);
}

/// Returns a bowl on a flat foot: z from 0 to 30 mm, inside a part of a sphere of radius 60 mm.
TriangleMesh bowl(const GeneratedMesh& request) {
  constexpr double kSphere_m = 0.060, kFloor_m = 0.003, kRim_m = 0.030;
  const auto inner_m = [&](double z_m) {
    const double above_m = z_m - kFloor_m;
    return std::sqrt(above_m * (2.0 * kSphere_m - above_m));
  };
  // Rings at equal distances along the sphere, with nearly square cells.
  const double angle = std::acos(1.0 - (kRim_m - kFloor_m) / kSphere_m);
  const double cells = 0.5 * static_cast<double>(request.triangles);
  const std::uint32_t down = at_least(std::sqrt(cells * angle / kFullTurn_rad), 3);
  std::vector<Ring> rings = {circle(0.0, 0.030), circle(kRim_m, inner_m(kRim_m) + 0.003)};
  for (std::uint32_t k = 0; k < down; ++k) {
    const double at = angle * (1.0 - static_cast<double>(k) / down);
    const double z_m = kFloor_m + kSphere_m * (1.0 - std::cos(at));
    rings.push_back(circle(z_m, inner_m(z_m)));
  }
  return lathe(even_angles(around_for(request, rings.size())), rings, {});
}

/// Returns a disc with a bore and with saw teeth above: a ramp that rises with the angle, then a wall. Two of
/// them fit face to face, z from 0 to 8 mm each, and turn against each other in one direction only.
TriangleMesh ratchet(const GeneratedMesh& request) {
  constexpr std::uint32_t kTeeth = 8;
  constexpr double kBore_m = 0.006, kRadius_m = 0.020, kRoot_m = 0.0055, kTip_m = 0.008;
  const std::uint32_t steps = at_least(static_cast<double>(request.triangles) / (8.0 * kTeeth), 1);
  TriangleMesh mesh;
  const auto vertex = [&](double radius_m, double angle, double z_m) {
    mesh.vertices_m.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    return static_cast<std::uint32_t>(mesh.vertices_m.size() - 1);
  };
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  // The points of one angle: below, and on the ramp that ends there or begins there.
  struct Spoke {
    std::uint32_t low_in, low_out, in, out;
  };
  const auto spoke_at = [&](double angle, double z_m) {
    return Spoke{vertex(kBore_m, angle, 0.0), vertex(kRadius_m, angle, 0.0), vertex(kBore_m, angle, z_m),
                 vertex(kRadius_m, angle, z_m)};
  };
  const Spoke first = spoke_at(0.0, kRoot_m);
  Spoke from = first;
  for (std::uint32_t tooth = 0; tooth < kTeeth; ++tooth) {
    for (std::uint32_t k = 1; k <= steps; ++k) {
      const double along = static_cast<double>(k) / steps;
      const double angle = kFullTurn_rad * (tooth + along) / kTeeth;
      const bool closes = tooth + 1 == kTeeth && k == steps;
      const double z_m = kRoot_m + (kTip_m - kRoot_m) * along;
      Spoke to;
      if (closes) {
        to = {first.low_in, first.low_out, vertex(kBore_m, 0.0, z_m), vertex(kRadius_m, 0.0, z_m)};
      } else {
        to = spoke_at(angle, z_m);
      }
      quad(from.in, from.out, to.out, to.in);
      quad(from.low_in, to.low_in, to.low_out, from.low_out);
      if (k < steps) {
        quad(from.low_out, to.low_out, to.out, from.out);
        quad(from.low_in, from.in, to.in, to.low_in);
        from = to;
        continue;
      }
      // The wall down to the next ramp. Its root is a corner of the sides, too.
      Spoke next = first;
      if (!closes)
        next = {to.low_in, to.low_out, vertex(kBore_m, angle, kRoot_m), vertex(kRadius_m, angle, kRoot_m)};
      quad(from.low_out, to.low_out, next.out, from.out);
      mesh.triangles.push_back({from.out, next.out, to.out});
      quad(from.low_in, from.in, next.in, to.low_in);
      mesh.triangles.push_back({from.in, to.in, next.in});
      quad(to.in, to.out, next.out, next.in);
      from = next;
    }
  }
  return mesh;
}

/// The outline of a keyhole (a circle with a slot towards +x) or of a key's bit, as radius over angle.
struct Keyhole {
  double radius_m, half_width_m, reach_m;

  double operator()(double angle) const {
    const double c = std::cos(angle), s = std::abs(std::sin(angle));
    if (c <= 0.0 || s * radius_m >= half_width_m) return radius_m;
    return s * reach_m <= half_width_m * c ? reach_m / c : half_width_m / s;
  }
  /// Returns the angles of its corners [rad].
  std::array<double, 2> corners() const {
    return {std::atan2(half_width_m, reach_m), std::asin(half_width_m / radius_m)};
  }
};

/// Returns evenly spaced angles and the angles of the corners.
std::vector<double> angles_of(const Keyhole& shape, std::uint32_t around) {
  constexpr double kNear = 1e-3;  // minimum distance of angles [rad]; avoids thin triangles
  std::vector<double> angles;
  for (const double corner : shape.corners()) {
    angles.push_back(corner);
    angles.push_back(kFullTurn_rad - corner);
  }
  for (const double angle : even_angles(around))
    if (std::none_of(angles.begin(), angles.begin() + 4,
                     [&](double a) { return std::abs(a - angle) < kNear; }))
      angles.push_back(angle);
  std::sort(angles.begin(), angles.end());
  return angles;
}

/// Returns a key: a shaft with a bit near its lower end and a flat bow. The origin is the middle of the
/// shaft.
TriangleMesh key(const GeneratedMesh& request) {
  const Keyhole bit = {0.0030, 0.0012, 0.0080};
  const auto bow = [](double angle) {
    return 1.0 / std::hypot(std::cos(angle) / 0.010, std::sin(angle) / 0.0025);
  };
  const std::vector<Ring> rings = {circle(-0.025, 0.0022), circle(-0.024, 0.0030), circle(-0.0235, 0.0030),
                                   {-0.0230, bit},         {-0.0150, bit},         circle(-0.0145, 0.0030),
                                   circle(0.010, 0.0030),  {0.014, bow},           {0.025, bow}};
  return lathe(angles_of(bit, around_for(request, rings.size())), rings, {});
}

/// Returns a lock: a round plate with a keyhole, z from 0 to 6 mm, above a chamber that is open below.
TriangleMesh lock(const GeneratedMesh& request) {
  const Keyhole hole = {0.0033, 0.0015, 0.0084}, mouth = {0.0043, 0.0025, 0.0094};
  const std::vector<Ring> outside = {circle(-0.012, 0.020), circle(0.006, 0.020)};
  const std::vector<Ring> bore = {
      circle(-0.012, 0.0100), circle(0.0, 0.0100), {0.0, hole}, {0.005, hole}, {0.006, mouth}};
  return lathe(angles_of(hole, around_for(request, outside.size() + bore.size())), outside, bore);
}

/// A thread whose vertex lines follow the helix, so that few triangles form a sharp thread. Line j runs
/// around as a helix and joins line j + kLines after one turn.
///
///   z(j, angle) = z_j + pitch angle / 2 pi
class Thread {
 public:
  static constexpr double kPitch_m = 0.003;
  static constexpr double kRoot_m = 0.0040, kCrest_m = 0.0050;
  static constexpr std::uint32_t kLines = 4;  ///< lines per turn: root, root, crest, crest

  /// turns: an even number, so that all threads have the same phase about their middles. wider_m: radius in
  /// excess of the screw's [m]. The first and the last turn are cut off at the radius of line cut_off_to.
  Thread(std::uint32_t turns, std::uint32_t around, double wider_m, std::uint32_t cut_off_to)
      : turns_(turns), around_(around), wider_m_(wider_m), cut_off_to_(cut_off_to) {}

  /// Adds the thread between two rings that close its ends. inwards: the faces point to the axis, as those of
  /// a nut.
  void add_to(TriangleMesh& mesh, bool inwards, const std::vector<std::uint32_t>& below,
              const std::vector<std::uint32_t>& above) const {
    const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
    const std::uint32_t last = (turns_ - 1) * kLines;  // number of lines that complete a turn
    for (std::uint32_t j = 0; j <= last; ++j)
      for (std::uint32_t i = 0; i < around_; ++i) mesh.vertices_m.push_back(point(i, j));
    for (std::uint32_t j = last + 1; j <= last + kLines; ++j) mesh.vertices_m.push_back(point(0, j));
    // After its last column a line continues as the line one turn above.
    const auto at = [&](std::uint32_t i, std::uint32_t j) {
      if (i == around_) i = 0, j += kLines;
      return j <= last ? first + j * around_ + i : first + (last + 1) * around_ + (j - last - 1);
    };
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      if (inwards) std::swap(b, c);
      mesh.triangles.push_back({a, b, c});
    };
    for (std::uint32_t j = 0; j < last; ++j)
      for (std::uint32_t i = 0; i < around_; ++i) {
        add(at(i, j), at(i + 1, j), at(i + 1, j + 1));
        add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
      }
    // Each end has a ramp of one turn and the step at its start.
    for (std::uint32_t i = 0; i < around_; ++i) {
      const std::uint32_t next = (i + 1) % around_;
      add(below[i], below[next], at(i + 1, 0));
      add(below[i], at(i + 1, 0), at(i, 0));
      add(at(i, last), at(i + 1, last), above[next]);
      add(at(i, last), above[next], above[i]);
    }
    for (std::uint32_t j = 0; j < kLines; ++j) {
      add(below[0], at(0, j), at(0, j + 1));
      add(above[0], at(0, last + j + 1), at(0, last + j));
    }
  }

 private:
  Vector3d point(std::uint32_t i, std::uint32_t j) const {
    constexpr std::array<double, kLines> kHeight = {0.0, 0.2, 0.5, 0.7};  // in units of the pitch
    const double revolution = static_cast<double>(i) / around_, angle = kFullTurn_rad * revolution;
    const std::uint32_t below = j / kLines;  // number of turns below
    const double z = kPitch_m * (below + kHeight[j % kLines] + revolution - 0.5 * turns_);
    const std::uint32_t line = j <= kLines || j >= (turns_ - 1) * kLines ? cut_off_to_ : j % kLines;
    const double r = wider_m_ + (line < kLines / 2 ? kRoot_m : kCrest_m);
    return {r * std::cos(angle), r * std::sin(angle), z};
  }

  std::uint32_t turns_, around_;
  double wider_m_;
  std::uint32_t cut_off_to_;
};

/// Adds rings and the faces between them, as lathe() does, without the ends. Returns the vertices of each
/// ring, from low to high.
std::vector<std::vector<std::uint32_t>> add_rings(TriangleMesh& mesh, const std::vector<double>& angles,
                                                  const std::vector<Ring>& rings) {
  std::vector<std::vector<std::uint32_t>> all;
  for (const Ring& ring : rings) {
    std::vector<std::uint32_t>& numbers = all.emplace_back();
    for (const double angle : angles) {
      numbers.push_back(static_cast<std::uint32_t>(mesh.vertices_m.size()));
      const double r = ring.radius_m(angle);
      mesh.vertices_m.emplace_back(r * std::cos(angle), r * std::sin(angle), ring.z_m);
    }
  }
  for (std::size_t k = 0; k + 1 < all.size(); ++k)
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const std::size_t j = (i + 1) % angles.size();
      mesh.triangles.push_back({all[k][i], all[k][j], all[k + 1][j]});
      mesh.triangles.push_back({all[k][i], all[k + 1][j], all[k + 1][i]});
    }
  return all;
}

/// Closes a ring with a point on the axis.
void add_tip(TriangleMesh& mesh, const std::vector<std::uint32_t>& ring, double z_m, bool above) {
  const auto tip = static_cast<std::uint32_t>(mesh.vertices_m.size());
  mesh.vertices_m.emplace_back(0, 0, z_m);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const std::size_t j = (i + 1) % ring.size();
    mesh.triangles.push_back({tip, ring[above ? i : j], ring[above ? j : i]});
  }
}

/// Returns the radius of a hexagon at an angle. half_width_m: radius of its inscribed circle [m].
double hexagon(double angle, double half_width_m) {
  const double sixth = kFullTurn_rad / 6.0;
  return half_width_m / std::cos(angle - sixth * std::floor(angle / sixth) - 0.5 * sixth);
}

/// Returns the number of vertices around a thread that yields about the requested number of triangles, a
/// multiple of six.
std::uint32_t around_thread(const GeneratedMesh& request, double lines) {
  return (at_least(static_cast<double>(request.triangles) / (2.0 * lines), 12) + 5) / 6 * 6;
}

TriangleMesh screw(const GeneratedMesh& request) {
  constexpr std::uint32_t kTurns = 10;
  const std::uint32_t around = around_thread(request, Thread::kLines * kTurns + 5);
  const std::vector<double> angles = even_angles(around);
  const auto head = [](double angle) { return hexagon(angle, 0.0080); };
  const double end_m = 0.5 * kTurns * Thread::kPitch_m;
  TriangleMesh mesh;
  const auto point = add_rings(mesh, angles, {circle(-end_m - 0.001, 0.0030)});
  const auto top = add_rings(mesh, angles,
                             {circle(end_m + 0.001, 0.0045), {end_m + 0.0015, head}, {end_m + 0.0065, head}});
  add_tip(mesh, point.front(), -end_m - 0.001, false);
  Thread(kTurns, around, 0.0, 0).add_to(mesh, false, point.front(), top.front());
  add_tip(mesh, top.back(), end_m + 0.0065, true);
  return mesh;
}

TriangleMesh screw_nut(const GeneratedMesh& request) {
  constexpr std::uint32_t kTurns = 4;
  constexpr double kWider_m = 0.0001;
  const std::uint32_t around = around_thread(request, Thread::kLines * kTurns + 5);
  const std::vector<double> angles = even_angles(around);
  const auto side = [](double angle) { return hexagon(angle, 0.0085); };
  const double end_m = 0.5 * kTurns * Thread::kPitch_m + 0.001;
  TriangleMesh mesh;
  const auto outside =
      add_rings(mesh, angles, {circle(-end_m, 0.0062), {-end_m, side}, {end_m, side}, circle(end_m, 0.0062)});
  Thread(kTurns, around, kWider_m, Thread::kLines - 1).add_to(mesh, true, outside.front(), outside.back());
  return mesh;
}

/// An ellipsoid that contains the origin, so that every ray from the origin leaves it once.
struct Ellipsoid {
  Vector3d centre_m;
  Vector3d along;              ///< unit vector of its first axis
  double half_m, across_m[2];  ///< semi-axes; across_m[0] is horizontal

  double reach_m(const Vector3d& u) const {
    const Vector3d side = Vector3d::UnitZ().cross(along).norm() > 1e-3
                              ? Vector3d::UnitZ().cross(along).normalized()
                              : Vector3d::UnitY();
    const Vector3d up = along.cross(side);
    const auto scaled = [&](const Vector3d& p) {
      return Vector3d(p.dot(along) / half_m, p.dot(side) / across_m[0], p.dot(up) / across_m[1]);
    };
    const Vector3d d = scaled(u), c = scaled(centre_m);  // |r d - c| = 1
    const double dd = d.squaredNorm(), dc = d.dot(c);
    return (dc + std::sqrt(dc * dc + dd * (1.0 - c.squaredNorm()))) / dd;
  }
};

/// Returns an ellipsoid from the origin to a tip in a direction.
Ellipsoid limb(const Vector3d& direction, double tip_m, double wide_m, double thick_m) {
  const Vector3d along = direction.normalized();
  const double half_m = 0.545 * tip_m;
  return {(tip_m - half_m) * along, along, half_m, {wide_m, thick_m}};
}

/// Returns the distance of the hare's surface from the origin, in its neck, in a direction: a smooth maximum
/// over its parts.
double hare_reach_m(const Vector3d& u) {
  static const std::array<Ellipsoid, 9> parts = {{
      {{-0.012, 0, -0.022}, Vector3d::UnitX(), 0.034, {0.026, 0.030}},  // body
      {{0.012, 0, 0.012}, Vector3d::UnitX(), 0.022, {0.017, 0.017}},    // head
      limb({-0.15, 0.24, 1}, 0.075, 0.009, 0.007),                      // ears
      limb({-0.15, -0.24, 1}, 0.075, 0.009, 0.007),
      limb({0.7, 0.35, -0.9}, 0.052, 0.011, 0.011),  // fore paws
      limb({0.7, -0.35, -0.9}, 0.052, 0.011, 0.011),
      limb({-0.05, 0.62, -0.9}, 0.062, 0.014, 0.014),  // hind feet
      limb({-0.05, -0.62, -0.9}, 0.062, 0.014, 0.014),
      limb({-1, 0, -0.5}, 0.060, 0.012, 0.012),  // tail
  }};
  constexpr double kRound = 12.0;
  double sum = 0.0;
  for (const Ellipsoid& part : parts) sum += std::pow(part.reach_m(u) / 0.05, kRound);
  return 0.05 * std::pow(sum, 1.0 / kRound);
}

/// Every ray from the origin crosses the surface once, so the surface cannot intersect itself. Before, the
/// directions are moved towards long edges, on the flanks of the ears, as if springs acted along the edges.
TriangleMesh hare(const GeneratedMesh& request) {
  constexpr int kRounds = 60;
  TriangleMesh mesh = geodesic(at_least(std::sqrt(static_cast<double>(request.triangles) / 20.0), 1));
  std::vector<Vector3d>& directions = mesh.vertices_m;
  const std::size_t count = directions.size();
  std::vector<Vector3d> points(count), pulled(count);
  const auto reach = [&] {
    for (std::size_t i = 0; i < count; ++i) points[i] = hare_reach_m(directions[i]) * directions[i];
  };
  const auto upright = [&](const std::vector<Vector3d>& to) {
    return std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                       [&](const auto& t) { return to[t[0]].cross(to[t[1]]).dot(to[t[2]]) > 0.0; });
  };
  for (int round = 0; round < kRounds; ++round) {
    reach();
    std::fill(pulled.begin(), pulled.end(), Vector3d::Zero());
    for (const auto& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t i = t[k], j = t[(k + 1) % 3];  // every edge occurs once from each side
        pulled[i] += (points[i] - points[j]).norm() * directions[j];
      }
    for (Vector3d& p : pulled) p.normalize();
    if (!upright(pulled)) break;
    directions = pulled;
  }
  reach();
  mesh.vertices_m = points;
  return mesh;
}

struct Maker {
  std::string kind;
  TriangleMesh (*make)(const GeneratedMesh&);
};

const std::vector<Maker>& makers() {
  static const std::vector<Maker> all = {
      {"cube",
       [](const GeneratedMesh& m) {
         return box(m, {0.05, 0.05, 0.05});
       }},
      {"plate",
       [](const GeneratedMesh& m) {
         return box(m, {0.1, 0.1, 0.001});
       }},
      {"table",
       [](const GeneratedMesh& m) {
         return box(m, {0.3, 0.3, 0.02});
       }},
      {"sphere", [](const GeneratedMesh& m) { return bumpy(m, 0.03, 0.0); }},
      {"bumpy", [](const GeneratedMesh& m) { return bumpy(m, 0.04, 0.008); }},
      {"boulder", [](const GeneratedMesh& m) { return bumpy(m, 0.06, 0.008); }},
      {"peg", peg},
      {"hole", hole},
      {"bolt", bolt},
      {"nut", nut},
      {"gear", gear},
      {"box", [](const GeneratedMesh& m) { return box(m, m.size_m); }},
      {"dowel", dowel},
      {"socket", socket},
      {"key", key},
      {"lock", lock},
      {"screw", screw},
      {"screw_nut", screw_nut},
      {"hare", hare},
      {"bowl", bowl},
      {"ratchet", ratchet},
  };
  return all;
}

}  // namespace

TriangleMesh make_mesh(const GeneratedMesh& request) {
  for (const Maker& maker : makers())
    if (maker.kind == request.kind) return maker.make(request);
  throw std::invalid_argument("no mesh of kind '" + request.kind + "' can be made");
}

void write_off(std::ostream& out, const TriangleMesh& mesh) {
  const auto write = [&](double value, char after) {
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    out.write(text.data(), end - text.data()).put(after);
  };
  out << "OFF\n" << mesh.vertices_m.size() << ' ' << mesh.triangles.size() << " 0\n";
  for (const Vector3d& p : mesh.vertices_m) {
    write(p.x(), ' ');
    write(p.y(), ' ');
    write(p.z(), '\n');
  }
  for (const auto& [a, b, c] : mesh.triangles) out << "3 " << a << ' ' << b << ' ' << c << '\n';
}

}  // namespace wrenchd
