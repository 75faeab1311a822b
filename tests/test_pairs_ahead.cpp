// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/pairs_ahead.hpp"
#include "tests/support/handling.hpp"

namespace wrenchd {
namespace {

using namespace test;

constexpr std::uint32_t kPlenty = 1000000;

const Scene& bumpy_bodies() {
  static const Scene scene = scene_of(rough_handling()[7]);
  return scene;
}

/// A tool that slides along, turning and speeding up a little.
Pose along(double t) {
  return {rotation_from(t * Vector3d(0.0, 5e-4, 2e-4)), {0.10, 1e-4 * t + 2e-7 * t * t, -5e-5 * t}};
}

/// The servo loop's use of it: a look from the last pose to this one, then a look ahead. Answers whether the
/// way was listed.
bool tick(PairsAhead& pairs, const Pose& from, const Pose& to) {
  WalkBudget budget = {kPlenty};
  const bool listed = pairs.list(from, to, budget);
  pairs.look_ahead(to, to, budget);
  return listed;
}

TEST_CASE("what moves evenly needs no list at once", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const std::uint32_t at_first = pairs.made_at_once();
  CHECK(at_first >= 1);  // nothing was known of the motion
  CHECK(at_first <= 10);
  const std::uint32_t edition = pairs.edition();
  for (int i = 60; i < 160; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  CHECK(pairs.made_at_once() == at_first);
  CHECK(pairs.edition() > edition + 5);  // it left one list after the other
}

TEST_CASE("what turns round is listed at once", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const std::uint32_t before = pairs.made_at_once();
  const Pose aside = {along(59).rotation, along(59).translation_m + Vector3d(0, 0, 2e-3)};
  REQUIRE(tick(pairs, along(59), aside));
  CHECK(pairs.made_at_once() == before + 1);
  CHECK(pairs.listed().covers(along(59)));
  CHECK(pairs.listed().covers(aside));
}

TEST_CASE("a way that is too long for the budget is not listed, and what was listed remains",
          "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  REQUIRE(tick(pairs, along(0), along(1)));
  const std::uint32_t edition = pairs.edition();
  WalkBudget few = {20};
  const Pose far = {Quaterniond::Identity(), {-0.10, 0, 0}};
  CHECK_FALSE(pairs.list(along(1), far, few));
  CHECK(pairs.edition() == edition);
  CHECK(pairs.listed().covers(along(1)));
  CHECK(few.visits <= 20);
}

TEST_CASE("a tool that was put elsewhere is not expected to fly on", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 40; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  pairs.forget_motion();
  const Pose put = {Quaterniond::Identity(), {0, 0.105, 0}};
  const auto near = [&](double s) {
    return Pose{put.rotation, put.translation_m + s * Vector3d(0, 0, 1e-6)};
  };
  for (int i = 1; i < 20; ++i) REQUIRE(tick(pairs, near(i - 1), near(i)));
  CHECK(pairs.listed().covers(near(20)));
  const std::uint32_t before = pairs.made_at_once();
  for (int i = 20; i < 40; ++i) REQUIRE(tick(pairs, near(i - 1), near(i)));
  CHECK(pairs.made_at_once() == before);  // one list holds: it hardly moves
}

}  // namespace
}  // namespace wrenchd
