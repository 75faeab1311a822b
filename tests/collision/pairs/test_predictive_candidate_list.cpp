// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <utility>

#include <catch2/catch.hpp>

#include "collision/pairs/predictive_candidate_list.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_predictive_candidate_list {

namespace {

using namespace test;

constexpr std::uint32_t kPlenty = 1000000;

const Scene& bumpy_bodies() {
  static const Scene scene = scene_of(manipulation_cases()[7]);
  return scene;
}

/// A tool that translates, rotates and accelerates slightly.
Pose pose_on_path(double t) {
  return {rotation_from(t * Vector3d(0.0, 5e-4, 2e-4)), {0.10, 1e-4 * t + 2e-7 * t * t, -5e-5 * t}};
}

/// Use by the servo loop: a sweep from the last pose to this one, then a prefetch. Returns whether the path
/// was covered.
bool tick(PredictiveCandidateList& pairs, const Pose& from, const Pose& to) {
  VisitBudget budget = {kPlenty};
  const bool listed = pairs.ensure_covers(from, to, budget);
  pairs.prefetch(to, to, budget);
  return listed;
}

TEST_CASE("uniform motion needs no immediate list", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const std::uint32_t initially = pairs.immediate_lists();
  CHECK(initially >= 1);  // no motion was known
  CHECK(initially <= 6);
  int changes = 0;
  for (int i = 60; i < 160; ++i) {
    const CandidatePairs* before = &pairs.current();
    REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
    changes += &pairs.current() != before;
  }
  CHECK(pairs.immediate_lists() == initially);
  CHECK(changes > 5);  // the list changed several times
}

// The unit is node visits, not time. If the prefetch were left to the end, or an immediate list were long,
// one tick would have ten times the work of the others.
TEST_CASE("the work for prefetched lists is spread over the ticks", "[predictive_candidate_list]") {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 50'000}, {"boulder", 50'000}, Handling::slide, {}});
  const auto inside = [](int i) {  // many pairs are near
    return Pose{pose_on_path(i).rotation, pose_on_path(i).translation_m - Vector3d(0.003, 0, 0)};
  };
  PredictiveCandidateList pairs(scene);
  std::uint32_t most = 0, all = 0;
  for (int i = 1; i < 160; ++i) {
    VisitBudget budget = {kPlenty};
    REQUIRE(pairs.ensure_covers(inside(i - 1), inside(i), budget));
    pairs.prefetch(inside(i), inside(i), budget);
    if (i < 60) continue;
    most = std::max(most, kPlenty - budget.remaining);
    all += kPlenty - budget.remaining;
  }
  CHECK(all > 10000);
  CHECK(most < 3 * all / 100);
}

TEST_CASE("spare work makes lists younger, and the prefetch uses no more than that",
          "[predictive_candidate_list]") {
  const auto lists = [](std::uint32_t to_spare) {
    PredictiveCandidateList pairs(bumpy_bodies());
    int changes = 0;
    for (int i = 1; i < 200; ++i) {
      const CandidatePairs* before = &pairs.current();
      VisitBudget budget = {kPlenty};
      REQUIRE(pairs.ensure_covers(pose_on_path(i - 1), pose_on_path(i), budget));
      const std::uint32_t left = budget.remaining;
      pairs.prefetch(pose_on_path(i), pose_on_path(i), budget, 0.0, to_spare);
      changes += i >= 60 && &pairs.current() != before ? 1 : 0;
      if (i >= 60 && to_spare >= 1000) CHECK(left - budget.remaining <= to_spare);
    }
    return changes;
  };
  CHECK(lists(1000) > 1.5 * lists(0));
}

TEST_CASE("a tool at rest builds no list, however much work is spare", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  for (int i = 0; i < 100; ++i) {
    VisitBudget budget = {kPlenty};
    REQUIRE(pairs.ensure_covers(pose_on_path(59), pose_on_path(59), budget));
    pairs.prefetch(pose_on_path(59), pose_on_path(59), budget, 0.0, 1000);
    if (i >= 50) CHECK(budget.remaining == kPlenty);
  }
}

TEST_CASE("a late prefetched list is completed, and no immediate list is built",
          "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  int i = 1;
  for (; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const std::uint32_t before = pairs.immediate_lists();
  int changes = 0;
  for (; i < 90 && changes < 2; ++i) {
    const CandidatePairs* last = &pairs.current();
    VisitBudget budget = {kPlenty}, starved = {1};
    REQUIRE(pairs.ensure_covers(pose_on_path(i - 1), pose_on_path(i), budget));
    changes += &pairs.current() != last ? 1 : 0;
    if (changes == 2) CHECK(budget.remaining < kPlenty);  // the first one may be complete, this one not
    pairs.prefetch(pose_on_path(i), pose_on_path(i), starved);
  }
  REQUIRE(changes == 2);
  CHECK(pairs.immediate_lists() == before);
}

// A sweep may go farther than the tool moves in the end. The rest of its list is not continued.
TEST_CASE("a used list is not used again", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  int changes = 0;
  for (int i = 60; i < 160; ++i) {
    const CandidatePairs* before = &pairs.current();
    VisitBudget budget = {kPlenty};
    REQUIRE(pairs.ensure_covers(pose_on_path(i - 1), pose_on_path(i + 2), budget));
    const bool changed = &pairs.current() != before;
    pairs.prefetch(pose_on_path(i), pose_on_path(i), budget, 0.0, changed ? 1000 : 0);
    CHECK(pairs.current().covers(pose_on_path(i + 2)));
    changes += changed ? 1 : 0;
  }
  CHECK(changes > 5);
}

// For some ticks no work is available for the next list, until the current one expires.
TEST_CASE("an immediate list takes precedence over a prefetched list that cannot be completed in time",
          "[predictive_candidate_list]") {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 50'000}, {"boulder", 50'000}, Handling::slide, {}});
  const auto round = [](int i) {
    const double angle = 2e-3 * i;
    return Pose{rotation_from(Vector3d(0, 0, -angle)), 0.1 * Vector3d(std::cos(angle), std::sin(angle), 0)};
  };
  const auto builds_immediately = [&](std::uint32_t part) {
    PredictiveCandidateList pairs(scene);
    int i = -60;
    double widest_m = 0.0;
    const auto go_to = [&](int last) {
      for (; i < last; ++i) {
        REQUIRE(tick(pairs, round(i - 1), round(i)));
        if (i >= -20) widest_m = std::max(widest_m, pairs.current().margin_m(round(i)));
      }
    };
    go_to(0);
    const std::uint32_t before = pairs.immediate_lists();
    for (VisitBudget budget; budget.remaining == 0 || budget.remaining == kPlenty; ++i) {
      REQUIRE(i < 100);
      budget = {kPlenty, kPlenty - part};
      const bool listed = pairs.ensure_covers(round(i - 1), round(i), budget);
      CHECK(listed != pairs.list_pending());
      CHECK(kPlenty - budget.remaining <= part + 1);
      VisitBudget starved = {2};
      pairs.prefetch(round(i), round(i), starved);
    }
    const bool made = pairs.immediate_lists() > before;
    // The predictions were correct, so the next lists need no larger reach.
    const double usual_m = std::exchange(widest_m, 0.0);
    go_to(i + 20);
    CHECK(widest_m < 1.2 * usual_m);
    return made;
  };
  CHECK_FALSE(builds_immediately(2000));  // the prefetched list is completed
  CHECK(builds_immediately(600));
  CHECK_FALSE(builds_immediately(100));  // the prefetched list continues
}

TEST_CASE("after an immediate list the next list starts where it ends", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const std::uint32_t before = pairs.immediate_lists();
  const auto aside = [&](int i) {
    return Pose{pose_on_path(i).rotation, pose_on_path(i).translation_m + Vector3d(0, 0, 3e-4)};
  };
  VisitBudget budget = {kPlenty};
  REQUIRE(pairs.ensure_covers(pose_on_path(59), aside(60), budget));
  pairs.prefetch(aside(60), pose_on_path(60), budget);
  for (int i = 61; i < 90; ++i) {
    budget = {kPlenty};
    REQUIRE(pairs.ensure_covers(aside(i - 1), aside(i), budget));
    pairs.prefetch(aside(i), pose_on_path(i), budget);
  }
  CHECK(pairs.immediate_lists() == before + 1);
}

TEST_CASE("a reversal of the motion causes an immediate list", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const std::uint32_t before = pairs.immediate_lists();
  const Pose aside = {pose_on_path(59).rotation, pose_on_path(59).translation_m + Vector3d(0, 0, 2e-3)};
  REQUIRE(tick(pairs, pose_on_path(59), aside));
  CHECK(pairs.immediate_lists() == before + 1);
  CHECK(pairs.current().covers(pose_on_path(59)));
  CHECK(pairs.current().covers(aside));
}

TEST_CASE("a path that exceeds the budget gets no list, and the current list remains",
          "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  REQUIRE(tick(pairs, pose_on_path(0), pose_on_path(1)));
  const CandidatePairs* before = &pairs.current();
  VisitBudget few = {20};
  const Pose far = {Quaterniond::Identity(), {-0.10, 0, 0}};
  CHECK_FALSE(pairs.ensure_covers(pose_on_path(1), far, few));
  CHECK(&pairs.current() == before);
  CHECK(pairs.current().covers(pose_on_path(1)));
  CHECK(few.remaining <= 20);
}

TEST_CASE("after a reset no motion is predicted", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 40; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  pairs.reset();
  const Pose put = {Quaterniond::Identity(), {0, 0.105, 0}};
  const auto near = [&](double s) {
    return Pose{put.rotation, put.translation_m + s * Vector3d(0, 0, 1e-6)};
  };
  for (int i = 1; i < 20; ++i) REQUIRE(tick(pairs, near(i - 1), near(i)));
  CHECK(pairs.current().covers(near(20)));
  const std::uint32_t before = pairs.immediate_lists();
  for (int i = 20; i < 40; ++i) REQUIRE(tick(pairs, near(i - 1), near(i)));
  CHECK(pairs.immediate_lists() == before);  // one list suffices: the tool hardly moves
}

// Deferrable work uses no more of a tick than its budget. The current list remains in use.
TEST_CASE("a deferrable list is built over several ticks and then used", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const std::uint32_t before = pairs.immediate_lists();
  const Pose aside = {pose_on_path(59).rotation, pose_on_path(59).translation_m + Vector3d(0, 0, 2e-3)};
  constexpr std::uint32_t kPart = 50;
  int late = 0;
  for (bool listed = false; !listed; ++late) {
    REQUIRE(late < 100);
    VisitBudget budget = {kPlenty, kPlenty - kPart};
    listed = pairs.ensure_covers(pose_on_path(59), aside, budget);
    CHECK(pairs.list_pending() == !listed);
    CHECK(kPlenty - budget.remaining <= kPart + 1);
    CHECK(pairs.current().covers(pose_on_path(59)));
    CHECK(pairs.covered_fraction(pose_on_path(59), aside) >= 0.0);
    if (!listed) CHECK(pairs.covered_fraction(pose_on_path(59), aside) < 1.0);
  }
  CHECK(late > 2);
  CHECK(pairs.immediate_lists() == before + 1);
  CHECK(pairs.current().covers(aside));
  CHECK(pairs.covered_fraction(pose_on_path(59), aside) == 1.0);
}

// A tick that may not defer work gets a list that is too expensive for it. If every tick began the list anew,
// the proxy would stand still for ever.
TEST_CASE("a list that exceeds the budget of one tick continues in the next ones",
          "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  constexpr std::uint32_t kSmall = 40;
  int ticks = 0;
  for (bool listed = false; !listed; ++ticks) {
    REQUIRE(ticks < 100);
    VisitBudget budget = {kSmall};
    listed = pairs.ensure_covers(pose_on_path(0), pose_on_path(1), budget);
    CHECK_FALSE(pairs.list_pending());  // the caller may try a shorter path
  }
  CHECK(ticks > 1);
  CHECK(pairs.current().node_visits() > kSmall);
  CHECK(pairs.current().covers(pose_on_path(1)));
}

TEST_CASE("a pending list is discarded if the path leads elsewhere", "[predictive_candidate_list]") {
  PredictiveCandidateList pairs(bumpy_bodies());
  for (int i = 1; i < 60; ++i) REQUIRE(tick(pairs, pose_on_path(i - 1), pose_on_path(i)));
  const auto aside = [&](double s) {
    return Pose{pose_on_path(59).rotation, pose_on_path(59).translation_m + s * Vector3d(0, 0, 2e-3)};
  };
  for (const double side : {1.0, -1.0, 1.0, -1.0}) {
    VisitBudget budget = {kPlenty, kPlenty - 33};
    CHECK_FALSE(pairs.ensure_covers(pose_on_path(59), aside(side), budget));
  }
  VisitBudget budget = {kPlenty};
  REQUIRE(pairs.ensure_covers(pose_on_path(59), aside(1.0), budget));
  CHECK(pairs.current().covers(aside(1.0)));
  CHECK_FALSE(pairs.list_pending());
}

}  // namespace
}  // namespace wrenchd::test_predictive_candidate_list
