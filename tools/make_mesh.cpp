// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/make_mesh.hpp"

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

constexpr double kTurn = 2.0 * std::numbers::pi;

std::uint32_t at_least(double wanted, std::uint32_t least) {
  return std::max(least, static_cast<std::uint32_t>(std::lround(wanted)));
}

/// Gives equal points one number.
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

/// The unit sphere: an icosahedron whose 20 faces are cut into f^2 triangles each.
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
  constexpr int kFaces[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                 {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                 {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                 {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  TriangleMesh mesh;
  Welder weld(mesh, 1e-7);
  for (const auto& [a, b, c] : kFaces) {
    const auto at = [&](std::uint32_t i, std::uint32_t j) {
      const double u = static_cast<double>(i) / f, v = static_cast<double>(j) / f;
      const auto corner = [&](int k) { return corners[static_cast<std::size_t>(k)]; };
      return weld(((1.0 - u - v) * corner(a) + u * corner(b) + v * corner(c)).normalized());
    };
    for (std::uint32_t i = 0; i < f; ++i)
      for (std::uint32_t j = 0; i + j < f; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < f) mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  return mesh;
}

/// A sphere with smooth bumps all over it: sums of sines with seeded directions and phases.
TriangleMesh bumpy(const MadeMesh& wanted, double radius_m, double height) {
  struct Wave {
    Vector3d k;
    double amplitude, phase;
  };
  std::mt19937 generator(wanted.seed);
  // The standard's distributions differ between libraries, its generators do not.
  const auto uniform = [&] { return (static_cast<double>(generator()) + 0.5) / 4294967296.0; };
  const auto normal = [&] { return std::sqrt(-2.0 * std::log(uniform())) * std::cos(kTurn * uniform()); };
  std::vector<Wave> waves;
  for (int i = 0; i < 24; ++i) {
    const double x = normal(), y = normal(), z = normal();
    waves.push_back(
        {(3.0 + i) * Vector3d(x, y, z).normalized(), height / (1.0 + 0.25 * i), kTurn * uniform()});
  }
  TriangleMesh mesh = geodesic(at_least(std::sqrt(static_cast<double>(wanted.triangles) / 20.0), 1));
  for (Vector3d& p : mesh.vertices_m) {
    double scale = 1.0;
    for (const auto& [k, amplitude, phase] : waves) scale += amplitude * std::sin(k.dot(p) + phase);
    p *= radius_m * scale;
  }
  return mesh;
}

/// A box cut into nearly square cells of two triangles each.
TriangleMesh box(const MadeMesh& wanted, const Vector3d& size_m) {
  const double area = 2.0 * (size_m.x() * size_m.y() + size_m.y() * size_m.z() + size_m.z() * size_m.x());
  const double cell_m = std::sqrt(2.0 * area / static_cast<double>(wanted.triangles));
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

/// Rings along z, closed by the two ends: what is turned, or has a constant profile.
struct Turned {
  double length_m;
  std::function<double(double angle, double z_m)> radius_m;
  std::function<double(double angle, double z_m)> bore_m;  ///< none: solid
  std::uint32_t around, along;
};

TriangleMesh turned(const Turned& body) {
  TriangleMesh mesh;
  const auto ring = [&](const auto& radius_m, std::uint32_t k) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
    const double z = body.length_m * (static_cast<double>(k) / body.along - 0.5);
    for (std::uint32_t i = 0; i < body.around; ++i) {
      const double angle = kTurn * i / body.around;
      const double r = radius_m(angle, z);
      mesh.vertices_m.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
    return first;
  };
  const auto strip = [&](std::uint32_t low, std::uint32_t high) {
    for (std::uint32_t i = 0; i < body.around; ++i) {
      const std::uint32_t j = (i + 1) % body.around;
      mesh.triangles.push_back({low + i, low + j, high + j});
      mesh.triangles.push_back({low + i, high + j, high + i});
    }
  };
  const auto rings = [&](const auto& radius_m) {
    std::vector<std::uint32_t> out;
    for (std::uint32_t k = 0; k <= body.along; ++k) out.push_back(ring(radius_m, k));
    return out;
  };
  const std::vector<std::uint32_t> outer = rings(body.radius_m);
  for (std::uint32_t k = 0; k < body.along; ++k) strip(outer[k], outer[k + 1]);
  if (body.bore_m) {
    const std::vector<std::uint32_t> inner = rings(body.bore_m);
    for (std::uint32_t k = 0; k < body.along; ++k) strip(inner[k + 1], inner[k]);
    strip(outer.back(), inner.back());
    strip(inner.front(), outer.front());
    return mesh;
  }
  const auto low = static_cast<std::uint32_t>(mesh.vertices_m.size());
  mesh.vertices_m.emplace_back(0, 0, -0.5 * body.length_m);
  mesh.vertices_m.emplace_back(0, 0, 0.5 * body.length_m);
  for (std::uint32_t i = 0; i < body.around; ++i) {
    const std::uint32_t j = (i + 1) % body.around;
    mesh.triangles.push_back({low, outer.front() + j, outer.front() + i});
    mesh.triangles.push_back({low + 1, outer.back() + i, outer.back() + j});
  }
  return mesh;
}

/// Cells around and along so that they are about square, and their triangles as many as wanted.
Turned cut(const MadeMesh& wanted, double length_m, double radius_m, int sheets) {
  const double cells = static_cast<double>(wanted.triangles) / (2.0 * sheets);
  const double around = std::sqrt(cells * kTurn * radius_m / length_m);
  return {length_m, {}, {}, at_least(around, 8), at_least(cells / around, 1)};
}

TriangleMesh peg(const MadeMesh& wanted) {
  Turned body = cut(wanted, 0.060, 0.0098, 1);
  body.radius_m = [](double angle, double z) {
    return 0.0098 + 0.00002 * std::sin(5.0 * angle) * std::sin(25.0 * z / 0.060);
  };
  return turned(body);
}

TriangleMesh hole(const MadeMesh& wanted) {
  Turned body = cut(wanted, 0.080, 0.0130, 2);
  body.radius_m = [](double, double) { return 0.020; };
  body.bore_m = [](double angle, double z) {
    return 0.0100 + 0.00002 * std::sin(5.0 * angle) * std::sin(25.0 * z / 0.080);
  };
  return turned(body);
}

/// 0 to 1 to 0 over one period.
double triangle_wave(double turns) {
  const double x = turns - std::floor(turns);
  return x < 0.5 ? 2.0 * x : 2.0 - 2.0 * x;
}

constexpr double kPitch_m = 0.0015;
constexpr double kThread_m = 0.0008;

double thread(double angle, double z) {
  return kThread_m * triangle_wave(z / kPitch_m - angle / kTurn);
}

TriangleMesh bolt(const MadeMesh& wanted) {
  Turned body = cut(wanted, 0.030, 0.005, 1);
  body.radius_m = [](double angle, double z) { return 0.0041 + thread(angle, z); };
  return turned(body);
}

TriangleMesh nut(const MadeMesh& wanted) {
  Turned body = cut(wanted, 0.008, 0.0067, 2);
  body.around = (body.around + 5) / 6 * 6;  // six corners
  body.radius_m = [](double angle, double) {
    const double sixth = kTurn / 6.0;
    const double off = angle - sixth * std::floor(angle / sixth) - 0.5 * sixth;
    return 0.0085 / std::cos(off);
  };
  body.bore_m = [](double angle, double z) { return 0.0042 + thread(angle, z); };
  return turned(body);
}

TriangleMesh gear(const MadeMesh& wanted) {
  constexpr double kTeeth = 20.0;
  Turned body = cut(wanted, 0.010, 0.021, 2);
  body.radius_m = [](double angle, double) {
    return 0.019 + 0.004 * std::clamp(2.4 * triangle_wave(kTeeth * angle / kTurn) - 0.7, 0.0, 1.0);
  };
  body.bore_m = [](double, double) { return 0.006; };
  return turned(body);
}

struct Maker {
  MeshKind kind;
  TriangleMesh (*make)(const MadeMesh&);
};

const std::vector<Maker>& makers() {
  static const std::vector<Maker> all = {
      {{"cube", "side 50 mm"},
       [](const MadeMesh& m) {
         return box(m, {0.05, 0.05, 0.05});
       }},
      {{"plate", "100 x 100 x 1 mm"},
       [](const MadeMesh& m) {
         return box(m, {0.1, 0.1, 0.001});
       }},
      {{"table", "300 x 300 x 20 mm"},
       [](const MadeMesh& m) {
         return box(m, {0.3, 0.3, 0.02});
       }},
      {{"sphere", "radius 30 mm"}, [](const MadeMesh& m) { return bumpy(m, 0.03, 0.0); }},
      {{"bumpy", "radius 40 mm, bumps all over"}, [](const MadeMesh& m) { return bumpy(m, 0.04, 0.008); }},
      {{"boulder", "radius 60 mm, bumps all over"}, [](const MadeMesh& m) { return bumpy(m, 0.06, 0.008); }},
      {{"peg", "radius 9.8 mm, length 60 mm, bumps of 20 um"}, peg},
      {{"hole", "tube for the peg: radii 10 and 20 mm, length 80 mm"}, hole},
      {{"bolt", "radius 4.9 mm, length 30 mm, thread of pitch 1.5 mm"}, bolt},
      {{"nut", "for the bolt: 17 mm across flats, 0.1 mm of play"}, nut},
      {{"gear", "20 teeth, radius 23 mm, 10 mm thick"}, gear},
  };
  return all;
}

}  // namespace

const std::vector<MeshKind>& mesh_kinds() {
  static const std::vector<MeshKind> kinds = [] {
    std::vector<MeshKind> out;
    for (const Maker& maker : makers()) out.push_back(maker.kind);
    return out;
  }();
  return kinds;
}

TriangleMesh make_mesh(const MadeMesh& wanted) {
  for (const Maker& maker : makers())
    if (maker.kind.name == wanted.kind) return maker.make(wanted);
  throw std::invalid_argument("no mesh of kind '" + wanted.kind + "' can be made");
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
