// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include <catch2/catch.hpp>

#include "collision/pair_sieve.hpp"
#include "collision/triangle_pair.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/repeats.hpp"
#include "tools/make_mesh.hpp"

namespace wrenchd {
namespace {

using namespace test;

struct Bodies {
  MeshSurface tool = MeshSurface(make_mesh({"bumpy", 500}), BodyKind::solid);
  MeshSurface obstacle = MeshSurface(make_mesh({"boulder", 800}), BodyKind::solid);

  double extent_m() const { return tool.radius_m() + obstacle.radius_m(); }
  std::uint32_t any(RandomValues& random, const MeshSurface& of) const {
    return static_cast<std::uint32_t>(random.integer(0, static_cast<int>(of.triangles().size()) - 1));
  }
};

/// A tool pose at which a triangle of the tool lies somewhere near one of the obstacle.
Pose near(RandomValues& random, const Bodies& bodies, std::uint32_t a, std::uint32_t b, double away_m) {
  const Quaterniond turn = random.rotation();
  return {turn, bodies.obstacle.corner_m(b, 0) - turn * bodies.tool.corner_m(a, 1) +
                    random.uniform(0.0, away_m) * random.unit<3>()};
}

/// On the straight way of each of its corners.
bool meet(const Bodies& bodies, std::uint32_t a, std::uint32_t b, const Frame& from, const Frame& to,
          double t) {
  Triangle moved, still;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Vector3d& p = bodies.tool.corner_m(a, k);
    moved[i] = (1.0 - t) * (from * p) + t * (to * p);
    still[i] = bodies.obstacle.corner_m(b, k);
  }
  return triangles_meet(moved, still);
}

TEST_CASE("a sieve leaves out no pair that meets on the way, on every kind of processor", "[pair_sieve]") {
  const Bodies bodies;
  RandomValues random(51);
  PairSieve fastest(8, 1), portable(8, 1, walk::sift_portable);
  int met = 0, left_out = 0;
  const int runs = repeats(20000);
  for (int n = 0; n < runs; ++n) {
    const std::uint32_t a = bodies.any(random, bodies.tool), b = bodies.any(random, bodies.obstacle);
    const Pose X_start = near(random, bodies, a, b, 0.01);
    // The turn is so small that a chord is as good as an arc.
    const Pose X_end = {(X_start.rotation * random.rotation(1e-4)).normalized(),
                        X_start.translation_m + random.decades(1e-6, 1e-2) * random.unit<3>()};
    const Frame from(X_start), to(X_end);
    const auto left = [&](PairSieve& sieve) {
      sieve.clear();
      sieve.add(bodies.tool, a, bodies.obstacle, b, 0);
      std::uint32_t pair = 7;
      const std::size_t count = sieve.sift(sieve.parts()[0], from, to, bodies.extent_m(), 1e-8, &pair);
      if (count == 1) CHECK(pair == 0);
      return count;
    };
    const std::size_t by_fastest = left(fastest), by_portable = left(portable);
    bool meets = false;
    for (int k = 0; k <= 20 && !meets; ++k) meets = meet(bodies, a, b, from, to, k / 20.0);
    met += meets;
    left_out += by_fastest == 0;
    if (meets) {
      CHECK(by_fastest == 1);
      CHECK(by_portable == 1);
    }
  }
  CHECK(met > runs / 100);
  CHECK(left_out > runs / 4);
}

TEST_CASE("a sieve leaves out what is kept apart by more than rounding and the margin", "[pair_sieve]") {
  const MeshSurface tool(make_mesh({"cube", 12}), BodyKind::solid);
  const MeshSurface obstacle(make_mesh({"cube", 12}), BodyKind::solid);
  const double size_m = 2.0 * obstacle.vertices_m()[0].cwiseAbs().maxCoeff();
  constexpr double kMargin_m = 1e-4;
  const auto left = [&](const Vector3d& from_m, const Vector3d& to_m) {
    PairSieve sieve(144, 1);
    for (std::uint32_t a = 0; a < 12; ++a)
      for (std::uint32_t b = 0; b < 12; ++b) sieve.add(tool, a, obstacle, b, 0);
    std::array<std::uint32_t, 144> pairs;
    return sieve.sift(sieve.parts()[0], Frame(Pose{Quaterniond::Identity(), from_m}),
                      Frame(Pose{Quaterniond::Identity(), to_m}), 2.0 * size_m, kMargin_m, pairs.data());
  };
  for (const Vector3d& way : {Vector3d(1, 0, 0), Vector3d(0, -1, 0), Vector3d(0, 0, 1)}) {
    const Vector3d apart = (size_m + 1.1 * kMargin_m) * way, near = (size_m + 0.9 * kMargin_m) * way;
    CHECK(left(apart, apart) == 0);
    CHECK(left(near, near) > 0);
    CHECK(left(apart, near) > 0);
    CHECK(left(near, apart) > 0);
    CHECK(left(apart, -apart) > 0);  // right through
  }
}

TEST_CASE("what is left is told by its number, over all parts and in order", "[pair_sieve]") {
  const Bodies bodies;
  RandomValues random(52);
  for (const walk::SieveKernel kernel :
       {walk::SieveKernel{nullptr}, walk::SieveKernel{walk::sift_portable}}) {
    PairSieve sieve(2000, 3, kernel), alone(1, 1, kernel);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    const Pose X = {random.rotation(), {0.05, 0.03, 0.0}};
    const Frame from(X), to(Pose{X.rotation, X.translation_m + Vector3d(0.0, 0.0, 1e-3)});
    for (const auto& [obstacle, count] : {std::pair{4U, 1003}, {1U, 5}, {9U, 600}})
      for (int n = 0; n < count; ++n) {
        pairs.emplace_back(bodies.any(random, bodies.tool), bodies.any(random, bodies.obstacle));
        sieve.add(bodies.tool, pairs.back().first, bodies.obstacle, pairs.back().second, obstacle);
      }
    REQUIRE(sieve.parts().size() == 3);
    CHECK(sieve.parts()[1].obstacle == 1);
    std::vector<std::uint32_t> left(2000), expected, all;
    for (const PairSieve::Part& part : sieve.parts()) {
      const std::size_t count = sieve.sift(part, from, to, bodies.extent_m(), 2e-3, left.data());
      all.insert(all.end(), left.begin(), left.begin() + static_cast<std::ptrdiff_t>(count));
    }
    for (std::uint32_t i = 0; i < pairs.size(); ++i) {
      alone.clear();
      alone.add(bodies.tool, pairs[i].first, bodies.obstacle, pairs[i].second, 0);
      if (alone.sift(alone.parts()[0], from, to, bodies.extent_m(), 2e-3, left.data()) == 1)
        expected.push_back(i);
    }
    CHECK(all == expected);
    CHECK_FALSE(expected.empty());
    CHECK(expected.size() < pairs.size());
  }
}

}  // namespace
}  // namespace wrenchd
