// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/proxy.hpp"
#include "core/metric.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/pocket_meshes.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/sweep_comparison.hpp"

namespace wrenchd::test_surface_contacts {

// Obstacles of kind "surface": their interior edges must not hold the tool, and nothing may pass through
// them.

namespace {

using namespace test;

/// Returns the mesh with randomly chosen edges split at a random point, so that its shape stays the same.
TriangleMesh split_at_random(TriangleMesh mesh, std::size_t triangles, std::uint64_t seed) {
  RandomValues random(seed);
  while (mesh.triangles.size() < triangles) {
    const auto t = static_cast<std::size_t>(random.uniform(0.0, 1.0) *
                                            static_cast<double>(mesh.triangles.size()) * (1.0 - 1e-12));
    const auto corners = mesh.triangles[t];
    std::size_t longest = 0;
    double length_m = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double l = (mesh.vertices_m[corners[i]] - mesh.vertices_m[corners[(i + 1) % 3]]).norm();
      if (l > length_m) length_m = l, longest = i;
    }
    const std::uint32_t a = corners[longest], b = corners[(longest + 1) % 3];
    const double share = random.uniform(0.3, 0.7);
    const auto middle = static_cast<std::uint32_t>(mesh.vertices_m.size());
    mesh.vertices_m.emplace_back((1.0 - share) * mesh.vertices_m[a] + share * mesh.vertices_m[b]);
    const std::size_t count = mesh.triangles.size();
    for (std::size_t k = 0; k < count; ++k)
      for (std::size_t i = 0; i < 3; ++i) {
        const auto c = mesh.triangles[k];
        const std::uint32_t from = c[i], to = c[(i + 1) % 3], apex = c[(i + 2) % 3];
        if (!((from == a && to == b) || (from == b && to == a))) continue;
        mesh.triangles[k] = {from, middle, apex};
        mesh.triangles.push_back({middle, to, apex});
        break;
      }
  }
  return mesh;
}

/// Returns the mesh with its vertices moved at random, as in a scan.
TriangleMesh with_noise(TriangleMesh mesh, double noise_m, std::uint64_t seed) {
  RandomValues random(seed);
  for (Vector3d& p : mesh.vertices_m) p += noise_m * random.unit<3>();
  return mesh;
}

/// A roof of 0.4 m x 0.2 m, 0.04 m high, with its ridge along x through the origin.
TriangleMesh ridge() {
  TriangleMesh mesh;
  mesh.vertices_m = {{-0.2, -0.1, -0.04}, {0.2, -0.1, -0.04}, {-0.2, 0.1, -0.04},
                     {0.2, 0.1, -0.04},   {-0.2, 0, 0},       {0.2, 0, 0}};
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {0, 1, 4}, {1, 5, 4}, {2, 4, 3}, {3, 4, 5}, {0, 4, 2}, {1, 3, 5}};
  return mesh;
}

Scene against(TriangleMesh tool, TriangleMesh obstacle, BodyKind kind) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"obstacle", MeshBvh(std::move(obstacle), kind), Pose{}});
  return Scene(mesh_tool(std::move(tool)), {}, {}, std::move(obstacles));
}

/// What differs between two proxies that follow the same hand.
struct Difference {
  std::vector<double> relative;  ///< difference of the energies of each tick, relative to the larger one
  long contacts = 0;
  long spent = 0;  ///< ticks in which one of the proxies did not converge

  double quantile(double share) {
    std::sort(relative.begin(), relative.end());
    return relative[static_cast<std::size_t>(share * static_cast<double>(relative.size() - 1))];
  }
};

Difference compare(const Scene& one, const Scene& other, const ManipulationCase& handling, int ticks) {
  Proxy first(one), second(other);
  HandTrajectory hand(handling);
  Pose X_first = {Quaterniond::Identity(), handling.start_m}, X_second = X_first;
  Difference difference;
  for (int tick = 0; tick < ticks; ++tick) {
    const Pose X_WP = hand.next();
    const Projection a = first.follow(X_WP, X_first), b = second.follow(X_WP, X_second);
    X_first = a.X_WQ;
    X_second = b.X_WQ;
    const double most = std::max(a.energy, b.energy);
    difference.contacts += a.energy > 0.0 ? 1 : 0;
    const auto is_spent = [](const Projection& q) { return q.status == ProjectionStatus::budget_spent; };
    difference.spent += is_spent(a) || is_spent(b) ? 1 : 0;
    // Energies of displacements below a micrometre are rounding.
    difference.relative.push_back(std::abs(a.energy - b.energy) /
                                  std::max(most, one.tool().solid.inertia.mass_kg * 1e-12));
  }
  return difference;
}

struct SolidCase {
  ManipulationCase handling;
  TriangleMesh tool, obstacle;
};

std::vector<SolidCase> solid_cases() {
  using enum Handling;
  const TriangleMesh cube = make_mesh({"cube", 12}), bumpy = make_mesh({"bumpy", 500});
  return {
      {{"cube on a ridge", {}, {}, slide, {0, 0, 0.03}}, cube, split_at_random(ridge(), 300, 1)},
      {{"cube on a noisy ridge", {}, {}, slide, {0, 0, 0.03}},
       cube,
       with_noise(split_at_random(ridge(), 300, 2), 2e-4, 3)},
      {{"cube in a tray", {}, {}, slide, {0, 0, 0.005}}, cube, split_at_random(tray(), 400, 4)},
      {{"cube in a noisy tray", {}, {}, slide, {0, 0, 0.005}},
       cube,
       with_noise(split_at_random(tray(), 400, 4), 2e-4, 5)},
      {{"bumpy body on a boulder", {}, {}, slide, {0, 0, 0.11}}, bumpy, make_mesh({"boulder", 1000})},
      {{"bumpy body on a cube", {}, {}, slide, {0, 0, 0.072}},
       bumpy,
       split_at_random(make_mesh({"cube", 12}), 500, 6)},
  };
}

TEST_CASE("for a closed surface that is known to divide space a proxy lists the pairs of the solid",
          "[surface_contacts]") {
  const ManipulationCase handling = {"cube in a noisy tray", {}, {}, Handling::slide, {0, 0, 0.005}};
  const TriangleMesh tool = make_mesh({"cube", 2000});
  const TriangleMesh noisy_tray = with_noise(split_at_random(tray(), 2000, 4), 2e-4, 5);
  const auto listed_pairs = [&](BodyKind kind, bool divides_space) {
    MeshBvh mesh(noisy_tray, kind);
    mesh.divides_space = divides_space;
    std::vector<MeshObstacle> obstacles;
    obstacles.push_back({"obstacle", std::move(mesh), Pose{}});
    const Scene scene(mesh_tool(tool), {}, {}, std::move(obstacles));
    Proxy proxy(scene);
    HandTrajectory hand(handling);
    Pose X_WT = {Quaterniond::Identity(), handling.start_m};
    std::uint64_t sum = 0;
    for (int tick = 0; tick < 600; ++tick) {
      X_WT = proxy.follow(hand.next(), X_WT).X_WQ;
      sum += proxy.candidate_count();
    }
    return sum;
  };
  const std::uint64_t solid = listed_pairs(BodyKind::solid, false);
  CHECK(solid > 0);
  CHECK(listed_pairs(BodyKind::surface, true) <= solid);
  CHECK(listed_pairs(BodyKind::surface, false) > solid + solid / 5);
}

TEST_CASE("a tool that is placed on the other side of a closed surface is held there", "[surface_contacts]") {
  // A room of 1 m and a tool of 0.1 m. The hand pulls through the wall at x = 0.5 m from both sides.
  const auto scaled = [](TriangleMesh mesh, double size_m) {
    const double factor = size_m / (mesh.vertices_m[0] - mesh.vertices_m[1]).cwiseAbs().maxCoeff();
    for (Vector3d& p : mesh.vertices_m) p *= factor;
    return mesh;
  };
  MeshBvh room(scaled(make_mesh({"cube", 12}), 1.0), BodyKind::surface);
  room.divides_space = room.surface.is_closed();
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"room", std::move(room), Pose{}});
  const Scene scene(mesh_tool(scaled(make_mesh({"cube", 12}), 0.1)), {}, {}, std::move(obstacles));
  const auto at_x = [](double x_m) { return Pose{Quaterniond::Identity(), {x_m, 0.02, 0.01}}; };
  for (const bool is_told : {true, false}) {
    Proxy proxy(scene);
    const auto pull = [&](double from_m, double to_m) {
      if (is_told) proxy.clear_history();
      Pose X_WT = at_x(from_m);
      int spent = 0;
      for (int tick = 0; tick < 400; ++tick) {
        const Projection q = proxy.follow(at_x(from_m + (to_m - from_m) * std::min(1.0, 0.005 * tick)), X_WT);
        X_WT = q.X_WQ;
        spent += q.status == ProjectionStatus::budget_spent ? 1 : 0;
      }
      CHECK(spent == 0);  // a wall that is taken for the other side holds by the overlap test only
      return X_WT.translation_m.x();
    };
    CHECK(pull(0.8, 0.0) == Approx(0.55).margin(3e-9));
    CHECK(pull(0.0, 0.8) == Approx(0.45).margin(3e-9));
    CHECK(pull(0.8, 0.0) == Approx(0.55).margin(3e-9));
  }
}

TEST_CASE("a closed mesh as a surface holds a tool as the solid does", "[surface_contacts]") {
  for (const SolidCase& c : solid_cases()) {
    Difference d = compare(against(c.tool, c.obstacle, BodyKind::solid),
                           against(c.tool, c.obstacle, BodyKind::surface), c.handling, case_count(2000));
    INFO(c.handling.name << ": difference of the energy: median " << d.quantile(0.5) << ", p99.9 "
                         << d.quantile(0.999) << ", largest " << d.quantile(1.0) << ", " << d.contacts
                         << " ticks in contact");
    CHECK(d.quantile(0.5) < 1e-6);
    CHECK(d.quantile(0.999) < 0.01);
  }
}

TEST_CASE("the far sides of the walls of pockets do not hold a tool that slides and turns over their rims",
          "[surface_contacts]") {
  const TriangleMesh cube = make_mesh({"cube", 12});
  const ManipulationCase handling = {"", {}, {}, Handling::slide, {0, 0, 0.03}};
  for (const std::uint32_t n : {2, 3, 4, 6}) {
    Difference d =
        compare(against(cube, block_with_pockets(n), BodyKind::solid),
                against(cube, block_with_pockets(n), BodyKind::surface), handling, case_count(2000));
    INFO(n * n << " pockets: p99.9 " << d.quantile(0.999) << ", largest " << d.quantile(1.0) << ", "
               << d.contacts << " ticks in contact");
    CHECK(d.quantile(0.999) < 1e-9);
  }
}

TEST_CASE("a tool with pockets, as a surface, moves as the solid does over the edges of a box",
          "[surface_contacts]") {
  const ManipulationCase handling = {"", {}, {}, Handling::slide, {0, 0, 0.03}};
  TriangleMesh box = make_mesh({"cube", 12});
  for (Vector3d& p : box.vertices_m) p.z() -= 0.025;  // its top is in z = 0
  for (const std::uint32_t n : {2, 3, 4, 6}) {
    TriangleMesh block = block_with_pockets(n);
    for (Vector3d& p : block.vertices_m) p = Vector3d(p.x(), -p.y(), -p.z());  // the pockets are below
    const auto with_tool = [&](BodyKind kind) {
      ToolBody tool = mesh_tool(block);
      tool.kind = kind;
      std::vector<MeshObstacle> obstacles;
      obstacles.push_back({"obstacle", MeshBvh(box, BodyKind::solid), Pose{}});
      return Scene(std::move(tool), {}, {}, std::move(obstacles));
    };
    Difference d =
        compare(with_tool(BodyKind::solid), with_tool(BodyKind::surface), handling, case_count(2000));
    INFO(n * n << " pockets: p99.9 " << d.quantile(0.999) << ", " << d.contacts << " ticks in contact");
    CHECK(d.contacts > case_count(2000) / 4);
    CHECK(d.quantile(0.999) < 1e-9);
  }
}

/// A flat sheet of 0.2 m square in z = 0, in n x n cells. alternate: every second cell is wound the other
/// way.
TriangleMesh sheet(std::uint32_t n, bool alternate) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j)
      mesh.vertices_m.emplace_back(0.2 * i / n - 0.1, 0.2 * j / n - 0.1, 0.0);
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      const bool turned = alternate && (i + j) % 2 == 1;
      mesh.triangles.push_back(turned ? std::array{b, a, b + 1} : std::array{a, b, b + 1});
      mesh.triangles.push_back(turned ? std::array{b + 1, a, a + 1} : std::array{a, b + 1, a + 1});
    }
  return mesh;
}

/// Moves the vertices up and down, so that the sheet has peaks, pits and saddles.
TriangleMesh wavy(TriangleMesh mesh) {
  for (Vector3d& p : mesh.vertices_m) p.z() += 0.002 * std::sin(170.0 * p.x()) * std::cos(140.0 * p.y());
  return mesh;
}

/// Adds a rib below each second line of a sheet of n x n cells, so that the line has edges of three faces.
TriangleMesh with_ribs(TriangleMesh mesh, std::uint32_t n) {
  for (std::uint32_t i = 0; i <= n; i += 2) {
    std::vector<std::uint32_t> below;
    for (std::uint32_t j = 0; j <= n; ++j) {
      below.push_back(static_cast<std::uint32_t>(mesh.vertices_m.size()));
      mesh.vertices_m.emplace_back(mesh.vertices_m[i * (n + 1) + j] - Vector3d(0, 0, 0.02));
    }
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j;
      mesh.triangles.push_back({a, a + 1, below[j]});
      mesh.triangles.push_back({a + 1, below[j + 1], below[j]});
    }
  }
  return mesh;
}

TEST_CASE("the winding of a surface and ribs on its far side do not change how it holds a tool",
          "[surface_contacts]") {
  constexpr std::uint32_t kCells = 10;
  const TriangleMesh cube = make_mesh({"cube", 12});
  const ManipulationCase handling = {"", {}, {}, Handling::slide, {0, 0, 0.03}};
  for (const bool is_wavy : {false, true}) {
    const auto shaped = [&](const TriangleMesh& mesh) { return is_wavy ? wavy(mesh) : mesh; };
    const TriangleMesh plain = shaped(sheet(kCells, false));
    for (const TriangleMesh& other : {shaped(sheet(kCells, true)), with_ribs(plain, kCells)}) {
      Difference d = compare(against(cube, plain, BodyKind::surface), against(cube, other, BodyKind::surface),
                             handling, case_count(1500));
      INFO((is_wavy ? "wavy" : "flat")
           << ": p99.9 " << d.quantile(0.999) << ", " << d.contacts << " ticks in contact");
      CHECK(d.quantile(0.5) < 1e-6);
      CHECK(d.quantile(0.999) < 0.01);
      CHECK(d.spent <= case_count(1500) / 1000);  // a tool touches on both sides of a face
    }
  }
}

TEST_CASE("the border of a sheet holds a tool as that of a thin plate does", "[surface_contacts]") {
  constexpr double kThickness_m = 1e-7;
  TriangleMesh plate = make_mesh({"box", 12, 1, {0.2, 0.2, kThickness_m}});
  const TriangleMesh cube = make_mesh({"cube", 12});
  for (const Vector3d& start_m :
       {Vector3d(0.1, 0, 0.03), Vector3d(0.13, 0.13, 0.02), Vector3d(0.14, 0, 0.004)}) {
    const ManipulationCase handling = {"", {}, {}, Handling::slide, start_m};
    Difference d = compare(against(cube, plate, BodyKind::solid),
                           against(cube, sheet(4, true), BodyKind::surface), handling, case_count(1500));
    INFO("from " << start_m.transpose() << ": median " << d.quantile(0.5) << ", p99 " << d.quantile(0.99)
                 << ", " << d.contacts << " ticks in contact");
    CHECK(d.quantile(0.5) < 1e-3);
    CHECK(d.quantile(0.95) < 0.01);
  }
}

/// A Moebius band around the z axis, 0.1 m in radius and 0.06 m wide, of n segments. The winding reverses at
/// the segment `seam`.
TriangleMesh moebius_band(std::uint32_t n, std::uint32_t seam) {
  TriangleMesh mesh;
  for (std::uint32_t k = 0; k < n; ++k) {
    const double turn = 2.0 * std::numbers::pi * (seam + k) / n;
    const Vector3d out(std::cos(turn), std::sin(turn), 0.0);
    const Vector3d across = std::cos(0.5 * turn) * out + std::sin(0.5 * turn) * Vector3d::UnitZ();
    for (const double side : {-0.03, 0.03}) mesh.vertices_m.emplace_back(0.1 * out + side * across);
  }
  for (std::uint32_t k = 0; k < n; ++k) {
    const std::uint32_t a = 2 * k, b = a + 1;
    const std::uint32_t c = k + 1 < n ? a + 2 : 1, d = k + 1 < n ? a + 3 : 0;  // the ends join turned over
    const bool second_turn = seam + k >= n;  // the sides are then exchanged, but the diagonals are the same
    mesh.triangles.push_back(second_turn ? std::array{a, c, d} : std::array{a, c, b});
    mesh.triangles.push_back(second_turn ? std::array{a, d, b} : std::array{b, c, d});
  }
  return mesh;
}

TEST_CASE("nothing passes through a Moebius band, and its interior edges do not hold a tool",
          "[surface_contacts]") {
  const TriangleMesh band = moebius_band(48, 0);
  const Scene other = against(make_mesh({"cube", 12}), moebius_band(48, 17), BodyKind::surface);
  const Scene scene = against(make_mesh({"cube", 12}), band, BodyKind::surface);
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), band);
  // The tool presses onto the band and goes around it twice: once on either side.
  for (const double side : {1.0, -1.0}) {
    Proxy proxy(scene), proxy_of_other(other);
    Pose X_WQ = {Quaterniond::Identity(), {0.1, 0.0, 0.04 * side}}, X_other = X_WQ;
    REQUIRE_FALSE(exact.intersect(X_WQ));
    long converged = 0, contacts = 0, differ = 0;
    const int ticks = case_count(1500);
    for (int tick = 0; tick < ticks; ++tick) {
      const double turn = 4.0 * std::numbers::pi * tick / 1500.0;
      const Vector3d out(std::cos(turn), std::sin(turn), 0.0);
      const Vector3d along(-std::sin(turn), std::cos(turn), 0.0);
      const Vector3d across = std::cos(0.5 * turn) * out + std::sin(0.5 * turn) * Vector3d::UnitZ();
      const Vector3d normal = side * across.cross(along);
      Matrix3d R_WP;
      R_WP << across, along, across.cross(along);
      const Pose X_WP = {Quaterniond(R_WP), 0.1 * out + 0.022 * normal};
      const Projection q = proxy.follow(X_WP, X_WQ);
      X_WQ = q.X_WQ;
      INFO("side " << side << ", tick " << tick);
      REQUIRE(q.status != ProjectionStatus::infeasible);
      REQUIRE_FALSE(exact.intersect(X_WQ));
      REQUIRE((X_WQ.translation_m - 0.1 * out).dot(normal) > 0.0);  // on the side on which it was
      converged += q.status == ProjectionStatus::converged ? 1 : 0;
      contacts += q.status != ProjectionStatus::free ? 1 : 0;
      X_other = proxy_of_other.follow(X_WP, X_other).X_WQ;
      differ += (X_WQ.translation_m - X_other.translation_m).norm() > 1e-6 ? 1 : 0;
    }
    CHECK(contacts > ticks / 2);
    CHECK(converged > contacts * 9 / 10);
    CHECK(differ <= ticks / 100);  // it does not stick at the seam
  }
}

TEST_CASE("wrenchd's kernels and CGAL meet the same contacts at borders, ribs and a Moebius band",
          "[surface_contacts]") {
  const TriangleMesh cube = make_mesh({"cube", 12}), bumpy = make_mesh({"bumpy", 500});
  const TriangleMesh wavy_sheet = wavy(sheet(6, true));
  struct Case {
    const char* name;
    TriangleMesh tool, surface;
    Vector3d start_m;
  };
  const std::vector<Case> cases = {{"sheet", cube, sheet(4, true), {0.08, 0.08, 0.03}},
                                   {"wavy sheet", bumpy, wavy_sheet, {0.05, 0, 0.055}},
                                   {"ribs", cube, with_ribs(sheet(6, false), 6), {0.1, 0, -0.03}},
                                   {"wavy ribs", cube, with_ribs(wavy_sheet, 6), {0.1, 0, 0.031}},
                                   {"band", cube, moebius_band(24, 5), {0.1, 0, 0.034}}};
  long contacts = 0, touching = 0;
  for (const Case& c : cases) {
    const Scene scene = against(c.tool, c.surface, BodyKind::surface);
    const ManipulationCase handling = {c.name, {}, {}, Handling::slide, c.start_m};
    SweepComparison comparison(scene);
    Proxy proxy(scene);
    HandTrajectory hand(handling);
    RandomValues random(4);
    Pose X_WQ = {Quaterniond::Identity(), c.start_m};
    for (int tick = 0; tick < case_count(150); ++tick) {
      const Projection q = proxy.follow(hand.next(), X_WQ);
      comparison.compare(X_WQ, q.X_WQ);
      X_WQ = q.X_WQ;
      for (int k = 0; k < 2; ++k)
        comparison.compare(X_WQ,
                           {(X_WQ.rotation * random.rotation(random.log_uniform(1e-9, 0.05))).normalized(),
                            X_WQ.translation_m + random.log_uniform(1e-9, 0.02) * random.unit<3>()});
    }
    INFO(c.name << ": " << comparison.counts().first_difference);
    CHECK(comparison.counts().different == 0);
    CHECK(comparison.counts().largest_difference == 0.0);
    contacts += comparison.counts().contacts;
    touching += comparison.counts().touching;
  }
  CHECK(contacts > case_count(500));
  CHECK(touching > case_count(500));
}

/// A closed shell around the origin, which each ray from the origin meets once.
bool encloses(const TriangleMesh& shell, const Vector3d& p_m) {
  for (const auto& [a, b, c] : shell.triangles) {
    Matrix3d corners;
    corners << shell.vertices_m[a], shell.vertices_m[b], shell.vertices_m[c];
    const Vector3d share = corners.inverse() * p_m;  // p as a sum of the corners
    if (share.minCoeff() >= -1e-12) return share.sum() < 1.0;
  }
  return false;
}

TEST_CASE("a tool caged in a closed shell taken as a surface never leaves it", "[surface_contacts]") {
  const auto scaled = [](TriangleMesh mesh, double scale) {
    for (Vector3d& p : mesh.vertices_m) p *= scale;
    return mesh;
  };
  struct Cage {
    const char* name;
    TriangleMesh tool, shell;
  };
  const std::vector<Cage> cages = {
      {"cube in a sphere", make_mesh({"cube", 12}), scaled(make_mesh({"sphere", 500}), 2.5)},
      {"bumpy body in a boulder", make_mesh({"bumpy", 500}), scaled(make_mesh({"boulder", 1000}), 1.8)},
      {"gear in an irregular cube", make_mesh({"gear", 600}),
       with_noise(split_at_random(scaled(make_mesh({"cube", 12}), 3.0), 300, 7), 1e-3, 8)},
      {"cube in a cube", make_mesh({"cube", 12}), scaled(make_mesh({"cube", 12}), 2.0)},
  };
  for (const Cage& cage : cages) {
    const Scene scene = against(cage.tool, cage.shell, BodyKind::surface);
    const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), cage.shell);
    Proxy proxy(scene);
    RandomValues random(9);
    Pose X_WQ, X_WP;
    Twist V;
    REQUIRE_FALSE(exact.intersect(X_WQ));
    for (int tick = 0; tick < case_count(600); ++tick) {
      if (tick % 15 == 0) {
        V.linear_m_per_s = random.log_uniform(0.1, 23.0) * random.unit<3>();
        V.angular_rad_per_s = random.uniform(0.0, 50.0) * random.unit<3>();
        X_WP.translation_m = 0.02 * random.unit<3>();
      }
      X_WP.translation_m += 1e-3 * V.linear_m_per_s;
      X_WP.rotation = (X_WP.rotation * rotation_from(1e-3 * V.angular_rad_per_s)).normalized();
      const Projection q = proxy.follow(X_WP, X_WQ);
      X_WQ = q.X_WQ;
      INFO(cage.name << ", tick " << tick);
      REQUIRE(q.status != ProjectionStatus::infeasible);
      REQUIRE_FALSE(exact.intersect(X_WQ));
      REQUIRE(encloses(cage.shell, X_WQ.translation_m));
    }
  }
}

TEST_CASE("a stab at 23 m/s does not pass through an open sheet from either side", "[surface_contacts]") {
  constexpr double kReach_m = 0.12, kSpeed_m_per_s = 23.0;
  const TriangleMesh wavy_sheet = wavy(sheet(10, true));
  for (const char* kind : {"cube", "bumpy", "gear"})
    for (const TriangleMesh& surface : {wavy_sheet, with_ribs(wavy_sheet, 10)})
      for (const double side : {1.0, -1.0}) {
        const Scene scene = against(make_mesh({kind, 300}), surface, BodyKind::surface);
        const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), surface);
        Proxy proxy(scene);
        RandomValues random(6);
        Pose X_WQ = {Quaterniond::Identity(), {0.0, 0.0, side * kReach_m}}, X_WP = X_WQ;
        double direction = -side;
        REQUIRE_FALSE(exact.intersect(X_WQ));
        for (int tick = 0; tick < case_count(300); ++tick) {
          if (std::abs(X_WP.translation_m.z()) >= kReach_m)
            direction = X_WP.translation_m.z() > 0.0 ? -1.0 : 1.0;
          X_WP.translation_m.z() += direction * 1e-3 * kSpeed_m_per_s * random.uniform(0.2, 1.0);
          X_WP.translation_m.head<2>() = 0.02 * random.unit<2>();
          X_WP.rotation = (X_WP.rotation * random.rotation(0.02)).normalized();
          X_WQ = proxy.follow(X_WP, X_WQ).X_WQ;
          INFO(kind << " on side " << side << ", tick " << tick);
          REQUIRE_FALSE(exact.intersect(X_WQ));
          REQUIRE(side * X_WQ.translation_m.z() > 0.0);
        }
      }
}

}  // namespace
}  // namespace wrenchd::test_surface_contacts
