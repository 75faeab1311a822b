// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <utility>

#include <catch2/catch.hpp>

#include "collision/pairs/predictive_candidate_list.hpp"
#include "tests/support/manipulation_case.hpp"

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
  CHECK(at_first <= 6);
  int changes = 0;
  for (int i = 60; i < 160; ++i) {
    const NearPairs* before = &pairs.listed();
    REQUIRE(tick(pairs, along(i - 1), along(i)));
    changes += &pairs.listed() != before;
  }
  CHECK(pairs.made_at_once() == at_first);
  CHECK(changes > 5);  // it left one list after the other
}

// In visits, not in time. Where the list ahead were left to the end, or the one at once were a long one, a
// tick would have ten times the work of the others.
TEST_CASE("the work for lists ahead is spread over the ticks", "[pairs_ahead]") {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 50'000}, {"boulder", 50'000}, Motion::slide, {}});
  const auto inside = [](int i) {  // where many pairs are near
    return Pose{along(i).rotation, along(i).translation_m - Vector3d(0.003, 0, 0)};
  };
  PairsAhead pairs(scene);
  std::uint32_t most = 0, all = 0;
  for (int i = 1; i < 160; ++i) {
    WalkBudget budget = {kPlenty};
    REQUIRE(pairs.list(inside(i - 1), inside(i), budget));
    pairs.look_ahead(inside(i), inside(i), budget);
    if (i < 60) continue;
    most = std::max(most, kPlenty - budget.visits);
    all += kPlenty - budget.visits;
  }
  CHECK(all > 10000);
  CHECK(most < 3 * all / 100);
}

TEST_CASE("with work to spare lists are younger, and what is spent is no more than that", "[pairs_ahead]") {
  const auto lists = [](std::uint32_t to_spare) {
    PairsAhead pairs(bumpy_bodies());
    int changes = 0;
    for (int i = 1; i < 200; ++i) {
      const NearPairs* before = &pairs.listed();
      WalkBudget budget = {kPlenty};
      REQUIRE(pairs.list(along(i - 1), along(i), budget));
      const std::uint32_t left = budget.visits;
      pairs.look_ahead(along(i), along(i), budget, 0.0, to_spare);
      changes += i >= 60 && &pairs.listed() != before ? 1 : 0;
      if (i >= 60 && to_spare >= 1000) CHECK(left - budget.visits <= to_spare);
    }
    return changes;
  };
  CHECK(lists(1000) > 1.5 * lists(0));
}

TEST_CASE("at rest nothing is listed, whatever there is to spare", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  for (int i = 0; i < 100; ++i) {
    WalkBudget budget = {kPlenty};
    REQUIRE(pairs.list(along(59), along(59), budget));
    pairs.look_ahead(along(59), along(59), budget, 0.0, 1000);
    if (i >= 50) CHECK(budget.visits == kPlenty);
  }
}

TEST_CASE("a list ahead that is late is ended, and none is made beside it", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  int i = 1;
  for (; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const std::uint32_t before = pairs.made_at_once();
  int changes = 0;
  for (; i < 90 && changes < 2; ++i) {
    const NearPairs* last = &pairs.listed();
    WalkBudget budget = {kPlenty}, starved = {1};
    REQUIRE(pairs.list(along(i - 1), along(i), budget));
    changes += &pairs.listed() != last ? 1 : 0;
    if (changes == 2) CHECK(budget.visits < kPlenty);  // the first may have been done, not this one
    pairs.look_ahead(along(i), along(i), starved);
  }
  REQUIRE(changes == 2);
  CHECK(pairs.made_at_once() == before);
}

// A look may go farther than the tool comes in the end: what was left for it is not gone back to.
TEST_CASE("a list that has served does not come back", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  int changes = 0;
  for (int i = 60; i < 160; ++i) {
    const NearPairs* before = &pairs.listed();
    WalkBudget budget = {kPlenty};
    REQUIRE(pairs.list(along(i - 1), along(i + 2), budget));
    const bool changed = &pairs.listed() != before;
    pairs.look_ahead(along(i), along(i), budget, 0.0, changed ? 1000 : 0);
    CHECK(pairs.listed().covers(along(i + 2)));
    changes += changed ? 1 : 0;
  }
  CHECK(changes > 5);
}

// For some ticks no work is left for the list ahead, until the one that serves holds no longer.
TEST_CASE("what can be made at once goes before a list ahead that cannot be ended in time", "[pairs_ahead]") {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 50'000}, {"boulder", 50'000}, Motion::slide, {}});
  const auto round = [](int i) {
    const double angle = 2e-3 * i;
    return Pose{rotation_from(Vector3d(0, 0, -angle)), 0.1 * Vector3d(std::cos(angle), std::sin(angle), 0)};
  };
  const auto made_at_once = [&](std::uint32_t part) {
    PairsAhead pairs(scene);
    int i = -60;
    double widest_m = 0.0;
    const auto go_to = [&](int last) {
      for (; i < last; ++i) {
        REQUIRE(tick(pairs, round(i - 1), round(i)));
        if (i >= -20) widest_m = std::max(widest_m, pairs.listed().room_m(round(i)));
      }
    };
    go_to(0);
    const std::uint32_t before = pairs.made_at_once();
    for (WalkBudget budget; budget.visits == 0 || budget.visits == kPlenty; ++i) {
      REQUIRE(i < 100);
      budget = {kPlenty, kPlenty - part};
      const bool listed = pairs.list(round(i - 1), round(i), budget);
      CHECK(listed != pairs.waits());
      CHECK(kPlenty - budget.visits <= part + 1);
      WalkBudget starved = {2};
      pairs.look_ahead(round(i), round(i), starved);
    }
    const bool made = pairs.made_at_once() > before;
    // The tool was where it was expected: the lists to come need not hold for more.
    const double usual_m = std::exchange(widest_m, 0.0);
    go_to(i + 20);
    CHECK(widest_m < 1.2 * usual_m);
    return made;
  };
  CHECK_FALSE(made_at_once(2000));  // the list ahead is ended
  CHECK(made_at_once(600));
  CHECK_FALSE(made_at_once(100));  // the list ahead is gone on with
}

TEST_CASE("after a list made at once the next leads on from where it ends", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const std::uint32_t before = pairs.made_at_once();
  const auto aside = [&](int i) {
    return Pose{along(i).rotation, along(i).translation_m + Vector3d(0, 0, 3e-4)};
  };
  WalkBudget budget = {kPlenty};
  REQUIRE(pairs.list(along(59), aside(60), budget));
  pairs.look_ahead(aside(60), along(60), budget);
  for (int i = 61; i < 90; ++i) {
    budget = {kPlenty};
    REQUIRE(pairs.list(aside(i - 1), aside(i), budget));
    pairs.look_ahead(aside(i), along(i), budget);
  }
  CHECK(pairs.made_at_once() == before + 1);
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
  const NearPairs* before = &pairs.listed();
  WalkBudget few = {20};
  const Pose far = {Quaterniond::Identity(), {-0.10, 0, 0}};
  CHECK_FALSE(pairs.list(along(1), far, few));
  CHECK(&pairs.listed() == before);
  CHECK(pairs.listed().covers(along(1)));
  CHECK(few.visits <= 20);
}

TEST_CASE("a tool that was put elsewhere is not expected to fly on", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 40; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  pairs.forget();
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

// What can wait takes no more of a tick than there is for it; the list that serves goes on to serve.
TEST_CASE("a list that may wait is made over several ticks, and serves then", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const std::uint32_t before = pairs.made_at_once();
  const Pose aside = {along(59).rotation, along(59).translation_m + Vector3d(0, 0, 2e-3)};
  constexpr std::uint32_t kPart = 50;
  int late = 0;
  for (bool listed = false; !listed; ++late) {
    REQUIRE(late < 100);
    WalkBudget budget = {kPlenty, kPlenty - kPart};
    listed = pairs.list(along(59), aside, budget);
    CHECK(pairs.waits() == !listed);
    CHECK(kPlenty - budget.visits <= kPart + 1);
    CHECK(pairs.listed().covers(along(59)));
    CHECK(pairs.share_listed(along(59), aside) >= 0.0);
    if (!listed) CHECK(pairs.share_listed(along(59), aside) < 1.0);
  }
  CHECK(late > 2);
  CHECK(pairs.made_at_once() == before + 1);
  CHECK(pairs.listed().covers(aside));
  CHECK(pairs.share_listed(along(59), aside) == 1.0);
}

TEST_CASE("a list that waits is given up where the way leads elsewhere", "[pairs_ahead]") {
  PairsAhead pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, along(i - 1), along(i)));
  const auto aside = [&](double s) {
    return Pose{along(59).rotation, along(59).translation_m + s * Vector3d(0, 0, 2e-3)};
  };
  for (const double side : {1.0, -1.0, 1.0, -1.0}) {
    WalkBudget budget = {kPlenty, kPlenty - 33};
    CHECK_FALSE(pairs.list(along(59), aside(side), budget));
  }
  WalkBudget budget = {kPlenty};
  REQUIRE(pairs.list(along(59), aside(1.0), budget));
  CHECK(pairs.listed().covers(aside(1.0)));
  CHECK_FALSE(pairs.waits());
}

}  // namespace
}  // namespace wrenchd
