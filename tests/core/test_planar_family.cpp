// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "core/metric.hpp"
#include "core/planar_family.hpp"
#include "tests/support/random_body.hpp"

namespace wrenchd::test_planar_family {

using namespace wrenchd::test;
using std::numbers::pi;

namespace {

/// Eq. (22) with phi = 0: the minimised energy.
double energy_at(const PlanarSection& s, double theta) {
  const double beta = -s.vx * std::sin(theta) - s.vy * std::cos(theta);
  const double half = std::sin(0.5 * theta);
  return s.m * (beta - s.h) * (beta - s.h) + 4.0 * s.H * half * half;
}

/// Returns the least energy on a grid over all admissible angles.
double scanned(const PlanarSection& s, int steps = 400) {
  double least = energy_at(s, s.theta_min);
  for (int i = 1; i <= steps; ++i)
    least = std::min(least, energy_at(s, s.theta_min + (s.theta_max - s.theta_min) * i / steps));
  return least;
}

/// Rounding of the energy: of the squares of the lengths in it.
double rounding(const PlanarSection& s) {
  return 1e-14 * (s.m * (s.vx * s.vx + s.vy * s.vy + s.h * s.h));
}

void require_least(const PlanarSection& s) {
  const PlanarMinimum found = minimise(s);
  INFO("m " << s.m << " H " << s.H << " v (" << s.vx << ", " << s.vy << ") h " << s.h << " theta in ["
            << s.theta_min << ", " << s.theta_max << "]");
  REQUIRE(found.theta >= s.theta_min);
  REQUIRE(found.theta <= s.theta_max);
  REQUIRE(found.T == Approx(energy_at(s, found.theta)).epsilon(1e-12).margin(rounding(s)));
  REQUIRE(found.beta == Approx(-s.vx * std::sin(found.theta) - s.vy * std::cos(found.theta))
                            .margin(1e-14 * (std::abs(s.vx) + std::abs(s.vy))));
  REQUIRE(found.T <= scanned(s) * (1.0 + 1e-12) + rounding(s));
}

PlanarSection random_section(RandomValues& random) {
  PlanarSection s;
  s.m = random.log_uniform(0.1, 10.0);
  s.H = s.m * random.log_uniform(0.01, 10.0);
  s.vx = random.normal();
  s.vy = random.normal();
  s.h = random.normal();
  s.theta_min = -pi;
  s.theta_max = pi;
  if (random.chance(0.7)) {
    s.theta_min = random.uniform(-pi, pi);
    s.theta_max =
        s.theta_min + random.uniform(0.0, pi);  // beyond pi too: an edge that starts below the obstacle
  }
  return s;
}

double barely(RandomValues& random) {
  return random.log_uniform(1e-18, 1e-3) * (random.chance(0.5) ? 1.0 : -1.0);
}

/// A body, a pose in which its deepest vertex is below a face of the scene, and that contact.
struct Pressed {
  ToolBody tool;
  Pose X_WP;
  Contact contact;
};

Pressed random_pressed(RandomValues& random) {
  Pressed c{random_body(random, random.integer(5, 25)), {random.rotation(), random.vector<3>()}, {}};
  c.contact.n_W = random.unit<3>();
  c.contact.offset_m = 0.0;
  double least = 0.0;
  const auto& vertices = c.tool.hull.vertices_T_m;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const double height = c.contact.n_W.dot(c.X_WP * vertices[v]);
    if (v > 0 && height >= least) continue;
    least = height;
    c.contact.tool_feature = static_cast<std::uint32_t>(v);
    c.contact.p_TCa_m = vertices[v];
  }
  c.contact.offset_m = least + random.uniform(0.02, 0.3);
  return c;
}

/// Checks that no multiple of 1.8 degrees about an axis of the family is admissible with less energy.
void require_least_of_free(const Pressed& c, const PlanarFamily& family) {
  const auto free = [&c](const Pose& X_WQ) {
    return std::all_of(
        c.tool.hull.vertices_T_m.begin(), c.tool.hull.vertices_T_m.end(),
        [&](const Vector3d& p) { return c.contact.n_W.dot(X_WQ * p) - c.contact.offset_m > 1e-9; });
  };
  for (int k = 0; k < family.planes(); ++k) {
    const auto solution = family.solve(c.X_WP, c.contact, k);
    for (int step = -100; step <= 100; ++step) {
      const Quaterniond turn(Eigen::AngleAxisd(step * pi / 100.0, solution.axis_W));
      Pose X_WQ{(turn * c.X_WP.rotation).normalized(), c.X_WP.translation_m};
      X_WQ.translation_m += (1e-8 - gap_m(c.contact, X_WQ)) * c.contact.n_W;
      if (!free(X_WQ)) continue;
      REQUIRE(energy(c.tool.solid.inertia, c.X_WP, X_WQ) >= solution.minimum.T * (1.0 - 1e-6));
    }
  }
}

/// The directions in which a plane cuts the faces around the vertex are above the obstacle at q, Eq. (21).
void require_section_free(const Pressed& c, const PlanarFamily::InPlane& solution) {
  const Pose X_WQ = PlanarFamily::pose(c.X_WP, c.contact, solution);
  const auto edge = [&c](std::uint32_t neighbour) -> Vector3d {
    return c.X_WP.rotation * (c.tool.hull.vertices_T_m[neighbour] - c.contact.p_TCa_m);
  };
  const auto ring = c.tool.hull.ring_of(c.contact.tool_feature);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vector3d one = edge(ring[i]);
    const Vector3d next = edge(ring[(i + 1) % ring.size()]);
    const double d_one = solution.axis_W.dot(one);
    const double d_next = solution.axis_W.dot(next);
    if (d_one * d_next >= 0.0) continue;
    const Vector3d cut = one + d_one / (d_one - d_next) * (next - one);
    REQUIRE(c.contact.n_W.dot(X_WQ.rotation * c.X_WP.rotation.conjugate() * cut) >= -1e-13);
  }
}

/// The cube of example 4.1 as a section: v at p, in axes with the obstacle's normal as y.
PlanarSection example(double scale) {
  constexpr double kPhi = -0.2;
  const double a = 25.0 * scale;
  PlanarSection s;
  s.m = 1.0;
  s.H = 4.0 * a * a / 6.0;
  s.vx = a * std::cos(kPhi) + a * std::sin(kPhi);
  s.vy = a * std::sin(kPhi) - a * std::cos(kPhi);
  s.h = a;
  s.theta_min =
      -kPhi - 0.5 * pi;  // the edge along x flat on the plane is theta = 0.2 from p; the other 90 degrees off
  s.theta_max = -kPhi;
  return s;
}

}  // namespace

TEST_CASE("example 4.1 in the plane", "[planar_family]") {
  const PlanarSection s = example(1.0);
  CHECK(-(s.h + s.vy) == Approx(4.46839771590757).epsilon(1e-13));  // depth of the deepest vertex
  const PlanarMinimum found = minimise(s);
  CHECK(found.theta - 0.2 == Approx(-0.0867146202807576).epsilon(1e-13));  // the paper's theta is absolute
  CHECK(found.beta == Approx(27.0712157435851).epsilon(1e-14));
  CHECK(found.T == Approx(9.63154218539309).epsilon(1e-13));
  CHECK(std::tan(0.5 * (found.theta - 0.2)) ==
        Approx(-0.04338450).epsilon(1e-7));  // root of the paper's quartic
}

TEST_CASE("example 4.1 at ten times the size: the same rotation, a hundred times the energy",
          "[planar_family]") {
  const PlanarMinimum one = minimise(example(1.0));
  const PlanarMinimum ten = minimise(example(10.0));
  CHECK(ten.theta == Approx(one.theta).epsilon(1e-14));
  CHECK(ten.beta == Approx(270.712157435851).epsilon(1e-14));
  CHECK(ten.T == Approx(963.154218539308).epsilon(1e-13));
}

TEST_CASE("no angle of a section has less energy than the result", "[planar_family]") {
  RandomValues random(1);
  for (int i = 0; i < 3'000; ++i) require_least(random_section(random));
}

TEST_CASE("the result is optimal with the vertex exactly or nearly below the centre of mass",
          "[planar_family]") {
  RandomValues random(2);
  for (int i = 0; i < 2'000; ++i) {
    PlanarSection s = random_section(random);
    s.vx = i % 4 == 0 ? 0.0 : barely(random);
    if (i % 2 == 0) s.vy = -s.h - random.uniform(0.0, 0.3);
    require_least(s);
  }
}

TEST_CASE("the result is optimal with the vertex exactly or nearly beside the centre of mass",
          "[planar_family]") {
  RandomValues random(3);
  for (int i = 0; i < 2'000; ++i) {
    PlanarSection s = random_section(random);
    s.vy = i % 4 == 0 ? 0.0 : barely(random);
    require_least(s);
  }
}

TEST_CASE("the result is optimal with the vertex exactly or nearly in contact, from either side",
          "[planar_family]") {
  RandomValues random(4);
  for (int i = 0; i < 2'000; ++i) {
    PlanarSection s = random_section(random);
    const double sign = i % 2 == 0 ? 1.0 : -1.0;  // h = vy is where A_1 vanishes
    s.h = sign * s.vy * (1.0 + (i % 4 < 2 ? 0.0 : barely(random)));
    require_least(s);
  }
}

TEST_CASE("the result is optimal for a tiny or huge moment of inertia", "[planar_family]") {
  RandomValues random(5);
  for (int i = 0; i < 3'000; ++i) {
    PlanarSection s = random_section(random);
    s.H = s.m * random.log_uniform(1e-15, 1e15);
    require_least(s);
  }
}

TEST_CASE("the result is optimal at any size", "[planar_family]") {
  RandomValues random(6);
  for (int i = 0; i < 2'000; ++i) {
    PlanarSection s = random_section(random);
    const double c = random.log_uniform(1e-6, 1e6);
    s.vx *= c;
    s.vy *= c;
    s.h *= c;
    s.H *= c * c;
    require_least(s);
  }
}

TEST_CASE("a vertex that just touches needs no motion", "[planar_family]") {
  RandomValues random(7);
  for (int i = 0; i < 1'000; ++i) {
    PlanarSection s = random_section(random);
    s.vy = -s.h;
    s.theta_min = -random.uniform(0.0, pi);
    s.theta_max = random.uniform(0.0, pi);
    const PlanarMinimum found = minimise(s);
    REQUIRE(found.T <= rounding(s));
    REQUIRE(std::abs(found.theta) <= 1e-6);
  }
}

TEST_CASE("without room to rotate the result is a translation along the normal", "[planar_family]") {
  RandomValues random(8);
  for (int i = 0; i < 1'000; ++i) {
    PlanarSection s = random_section(random);
    s.theta_min = s.theta_max = 0.0;
    const PlanarMinimum found = minimise(s);
    REQUIRE(found.theta == 0.0);
    REQUIRE(found.beta == -s.vy);
    REQUIRE(found.T == Approx(s.m * (s.vy + s.h) * (s.vy + s.h)).margin(rounding(s)));
  }
}

TEST_CASE("the mass scales the energy of a section and does not change the pose", "[planar_family]") {
  RandomValues random(9);
  for (int i = 0; i < 1'000; ++i) {
    PlanarSection s = random_section(random);
    const PlanarMinimum before = minimise(s);
    const double c = std::ldexp(1.0, random.integer(-10, 10));  // a power of two, which is exact
    s.m *= c;
    s.H *= c;
    const PlanarMinimum after = minimise(s);
    REQUIRE(after.theta == before.theta);
    REQUIRE(after.beta == before.beta);
    REQUIRE(after.T == c * before.T);
  }
}

TEST_CASE("the mirror image of a section rotates in the opposite direction", "[planar_family]") {
  RandomValues random(10);
  for (int i = 0; i < 1'000; ++i) {
    PlanarSection s = random_section(random);
    s.theta_min = -random.uniform(0.0, pi);
    s.theta_max = random.uniform(0.0, pi);
    const PlanarMinimum one = minimise(s);
    s.vx = -s.vx;
    std::swap(s.theta_min, s.theta_max);
    s.theta_min = -s.theta_min;
    s.theta_max = -s.theta_max;
    const PlanarMinimum other = minimise(s);
    REQUIRE(other.T == Approx(one.T).epsilon(1e-12).margin(rounding(s)));
  }
}

TEST_CASE("the pose of every plane has the vertex on the face and the minimised energy", "[planar_family]") {
  RandomValues random(11);
  for (int i = 0; i < 100; ++i) {
    const Pressed c = random_pressed(random);
    const Inertia& M = c.tool.solid.inertia;
    const PlanarFamily family(M, c.tool.hull, 17);
    REQUIRE(family.planes() == 17);
    for (int k = 0; k < family.planes(); ++k) {
      const auto solution = family.solve(c.X_WP, c.contact, k);
      const Pose X_WQ = PlanarFamily::pose(c.X_WP, c.contact, solution);
      REQUIRE(std::abs(solution.axis_W.dot(c.contact.n_W)) <= 1e-15);  // the axis lies in the obstacle plane
      REQUIRE(std::abs(gap_m(c.contact, X_WQ)) <= 1e-14);
      REQUIRE(energy(M, c.X_WP, X_WQ) == Approx(solution.minimum.T).epsilon(1e-12));
      // Only the height changes (line above Eq. (19)): the rest of the translation costs energy and frees
      // nothing.
      const Vector3d s = X_WQ.translation_m - c.X_WP.translation_m;
      REQUIRE(s.cross(c.contact.n_W).norm() <= 1e-15 * (1.0 + s.norm()));
    }
  }
}

TEST_CASE("no admissible rotation about a plane's axis has less energy", "[planar_family]") {
  // Algorithm 2 omits angles at which an edge of the cross-section, and so the body, is below the face.
  RandomValues random(12);
  for (int i = 0; i < 40; ++i) {
    const Pressed c = random_pressed(random);
    require_least_of_free(c, PlanarFamily(c.tool.solid.inertia, c.tool.hull, 5));
  }
}

TEST_CASE("the same holds at a vertex that is not the deepest, with angles on both sides of half a turn",
          "[planar_family]") {
  RandomValues random(16);
  int beyond_quarter = 0;
  for (int i = 0; i < 80; ++i) {
    Pressed c = random_pressed(random);
    const auto& vertices = c.tool.hull.vertices_T_m;
    c.contact.tool_feature =
        static_cast<std::uint32_t>(random.integer(0, static_cast<int>(vertices.size()) - 1));
    c.contact.p_TCa_m = vertices[c.contact.tool_feature];
    const PlanarFamily family(c.tool.solid.inertia, c.tool.hull, 5);
    require_least_of_free(c, family);
    for (int k = 0; k < family.planes(); ++k) {
      const auto solution = family.solve(c.X_WP, c.contact, k);
      require_section_free(c, solution);
      const double theta = solution.minimum.theta;
      REQUIRE(std::abs(theta) <= pi);
      beyond_quarter += std::abs(theta) > 0.5 * pi ? 1 : 0;
    }
  }
  REQUIRE(beyond_quarter > 20);  // otherwise the test is empty
}

TEST_CASE("one plane alone gives the same values as all planes of a contact together", "[planar_family]") {
  RandomValues random(17);
  const Pressed c = random_pressed(random);
  const PlanarFamily family(c.tool.solid.inertia, c.tool.hull, 47);
  const PlanarFamily::AtContact at = family.at(c.X_WP, c.contact);
  for (int k = 0; k < family.planes(); ++k) {
    const auto together = at.solve(k);
    const auto alone = family.solve(c.X_WP, c.contact, k);
    REQUIRE(together.minimum.theta == alone.minimum.theta);
    REQUIRE(together.minimum.beta == alone.minimum.beta);
    REQUIRE(together.minimum.T == alone.minimum.T);
    REQUIRE(together.axis_W == alone.axis_W);
  }
}

TEST_CASE("the energy of a shallow contact is accurate", "[planar_family]") {
  // To first order the vertex has the compliance  1/m + vx^2/H  along the normal:  T = depth^2 / (1/m +
  // vx^2/H).
  RandomValues random(18);
  for (int i = 0; i < 1'000; ++i) {
    PlanarSection s;
    s.m = random.log_uniform(0.1, 10.0);
    s.H = s.m * random.uniform(0.05, 0.5);
    s.vx = random.uniform(-0.5, 0.5);
    s.vy = -random.uniform(0.3, 0.9);
    s.h = -s.vy - random.log_uniform(1e-11, 1e-10);
    s.theta_min = -0.5;
    s.theta_max = 0.5;
    const double depth = -(s.vy + s.h);
    const PlanarMinimum found = minimise(s);
    REQUIRE(found.T == Approx(depth * depth / (1.0 / s.m + s.vx * s.vx / s.H)).epsilon(1e-7));
  }
}

TEST_CASE("planar is never better than exact and never worse than translation, for any number of planes",
          "[planar_family]") {
  RandomValues random(13);
  for (int i = 0; i < 60; ++i) {
    const Pressed c = random_pressed(random);
    const Scene scene(c.tool, {half_space(c.contact.n_W, c.contact.offset_m)});
    const auto depth = [&](Method method, int planes) {
      PenetrationDepth solver(scene, {method, planes});
      return solver.query(c.X_WP).projection.energy;
    };
    const double exact = depth(Method::exact, 1);
    const double translational = depth(Method::translational, 1);
    for (const int planes : {1, 2, 4, 16, 64}) {
      const double planar = depth(Method::planar, planes);
      INFO(planes << " planes");
      REQUIRE(planar >= exact * (1.0 - 1e-9));
      REQUIRE(planar <= translational * (1.0 + 1e-9));
    }
  }
}

TEST_CASE("adding planes never increases the least energy", "[planar_family]") {
  RandomValues random(15);
  for (int i = 0; i < 60; ++i) {
    const Pressed c = random_pressed(random);
    double before = std::numeric_limits<double>::infinity();
    for (const int planes : {1, 2, 4, 8, 16, 32}) {
      const PlanarFamily family(c.tool.solid.inertia, c.tool.hull, planes);
      double least = std::numeric_limits<double>::infinity();
      for (int k = 0; k < planes; ++k) least = std::min(least, family.solve(c.X_WP, c.contact, k).minimum.T);
      REQUIRE(least <= before * (1.0 + 1e-12));
      before = least;
    }
  }
}

TEST_CASE("a translation of the world changes no result of the family", "[planar_family]") {
  RandomValues random(14);
  for (int i = 0; i < 50; ++i) {
    const Pressed c = random_pressed(random);
    const PlanarFamily family(c.tool.solid.inertia, c.tool.hull, 7);
    const Pose a{Quaterniond::Identity(), random.vector<3>()};
    Contact moved_contact = c.contact;
    moved_contact.offset_m += c.contact.n_W.dot(a.translation_m);
    for (int k = 0; k < 7; ++k) {
      const auto here = family.solve(c.X_WP, c.contact, k);
      const auto there = family.solve(a * c.X_WP, moved_contact, k);
      REQUIRE(there.minimum.T == Approx(here.minimum.T).epsilon(1e-9));
      REQUIRE(there.minimum.theta == Approx(here.minimum.theta).margin(1e-9));
    }
  }
}

}  // namespace wrenchd::test_planar_family
