// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "core/finite.hpp"
#include "daemon/recording/replay.hpp"
#include "devices/deflection_pose.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_recorder.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_deflection_pose {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

constexpr double kTick_s = 0.001;
constexpr double kFastest_m_per_s = 0.5;
constexpr double kFastest_rad_per_s = 5.0;

/// Settings of a shipped SpaceMouse in round numbers: 0.1 m/s and 1 rad/s at full deflection.
Deflection steered() {
  Deflection d;
  d.linear_gain = 100.0;
  d.angular_gain = 10.0;
  d.full_deflection_m = 1e-3;
  d.full_deflection_rad = 0.1;
  d.dead_zone = 0.1;
  d.response_exponent = 2.0;
  d.max_proxy_distance_m = 0.010;
  d.max_proxy_angle_rad = 0.2;
  return d;
}

DeflectionPose pose_of(const Deflection& settings) {
  return {settings, kFastest_m_per_s, kFastest_rad_per_s};
}

/// A wall that fills x > 0: the proxy stays at x = 0.
void press(DeflectionPose& pose, const Vector3d& t, int ticks) {
  pose.set_deflection(t, Vector3d::Zero());
  for (int i = 0; i < ticks; ++i) {
    Pose held = pose.X_BH();
    held.translation_m.x() = std::min(held.translation_m.x(), 0.0);
    pose.set_proxy_pose(held);
    pose.advance(kTick_s);
  }
}

Pose pose_in(const std::array<double, 7>& x) {
  return {Quaterniond(x[6], x[3], x[4], x[5]), {x[0], x[1], x[2]}};
}

/// The shipped cube over its table, steered with an emulated SpaceMouse. Counts: x right, y toward the user,
/// z down.
struct Steered {
  explicit Steered(RunConfig shipped = shipped_config()) : plan(std::move(shipped)) {
    plan.profile = load_profile(test::source_path("config/profiles/spacemouse_combined.toml"),
                                SearchPath({test::source_path("config")}));
    runtime.emplace(plan, link, clock, ProxySearchMode::in_tick);
    runtime->open();
  }
  void tick() {
    clock.sleep_until(clock.now() + 1ms);
    fault = runtime->loop().tick(clock.now(), clock.now());
    runtime->loop().telemetry().latest_record().read(last);
  }
  void ticks(int count) {
    for (int i = 0; i < count; ++i) tick();
  }
  void up_from_the_table() {  // the cube starts in the table
    ticks(100);
    mouse.set_deflection({0, 0, -350, 0, 0, 0});
    ticks(500);
    mouse.set_deflection({});
    ticks(100);
    REQUIRE(last.contacts == 0);
  }
  double depth_m() const {
    return (pose_in(last.X_WP).translation_m - pose_in(last.X_WQ).translation_m).norm();
  }
  double turn_rad() const { return pose_in(last.X_WP).rotation.angularDistance(pose_in(last.X_WQ).rotation); }
  double push_up_N() const { return (pose_in(last.X_WP).rotation * Vector3d(last.F_T.data())).z(); }
  State state() const { return static_cast<State>(last.state); }

  RunConfig plan;
  VirtualClock clock;
  EmulatedSpaceMouse mouse{EmulatedSpaceMouse::Format::combined};
  LoopbackLink link{mouse, clock};
  std::optional<Runtime> runtime;
  TickRecord last;
  Fault fault = Fault::none;
};

constexpr std::array<int, 6> kDown = {0, 0, 350, 0, 0, 0};
constexpr std::array<int, 6> kUp = {0, 0, -350, 0, 0, 0};

}  // namespace

// --- the response curve ------------------------------------------------------------------------------------

TEST_CASE("the velocity is zero in the dead zone and maximal at full deflection", "[deflection_pose]") {
  const Deflection settings = steered();
  const SteeringCurve curve(settings, settings.linear_gain, settings.full_deflection_m);
  const Vector3d along = Vector3d(1, -2, 2) / 3.0;
  CHECK(curve.velocity(Vector3d::Zero()).isZero(0.0));
  CHECK(curve.velocity(0.1e-3 * along).norm() < 1e-12);
  CHECK((curve.velocity(1e-3 * along) - 0.1 * along).norm() < 1e-12);
  CHECK((curve.velocity(5e-3 * along) - 0.1 * along).norm() < 1e-12);
  CHECK((curve.velocity(0.55e-3 * along) - 0.025 * along).norm() <
        1e-12);  // half of the remaining range, squared
  double last = 0.0;
  for (double t = 0.11e-3; t < 1e-3; t += 1e-5) {
    CHECK(curve.velocity(t * along).norm() > last);
    last = curve.velocity(t * along).norm();
  }
}

TEST_CASE("velocity() and deflection() are inverse to each other", "[deflection_pose]") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0), share(1e-3, 1.0);
  for (const double power : {1.0, 2.0, 3.5}) {
    Deflection settings = steered();
    settings.response_exponent = power;
    const SteeringCurve curve(settings, settings.linear_gain, settings.full_deflection_m);
    for (int i = 0; i < 1000; ++i) {
      const Vector3d v = 0.1 * share(random) * Vector3d(any(random), any(random), any(random)).normalized();
      CHECK((curve.velocity(curve.deflection(v)) - v).norm() < 1e-12);
    }
    CHECK(curve.deflection(Vector3d(7.0, 0, 0)).norm() == Approx(1e-3));
    CHECK(curve.deflection(Vector3d(9e-6, 0, 0)).isZero(0.0));
  }
}

TEST_CASE("without a stated full deflection the speed is proportional to the deflection",
          "[deflection_pose]") {
  Deflection settings;
  settings.linear_gain = 71.0;
  const SteeringCurve curve(settings, settings.linear_gain, settings.full_deflection_m);
  CHECK((curve.velocity({1e-3, -2e-3, 9e-3}) - 71.0 * Vector3d(1e-3, -2e-3, 9e-3)).norm() == 0.0);
  CHECK((curve.deflection({0.071, 0, 0}) - Vector3d(1e-3, 0, 0)).norm() < 1e-15);
}

// --- the pose ---------------------------------------------------------------------------------------------

TEST_CASE("at a wall the distance to the proxy grows with the deflection and returns to zero at once",
          "[deflection_pose]") {
  DeflectionPose pose = pose_of(steered());
  press(pose, {1e-3, 0, 0}, 5000);
  CHECK(pose.X_BH().translation_m.x() == Approx(0.010).epsilon(0.02));
  press(pose, {0.55e-3, 0, 0}, 5000);
  CHECK(pose.X_BH().translation_m.x() == Approx(0.0025).epsilon(0.02));
  press(pose, {0, 0, 0}, 50);  // released
  CHECK(std::abs(pose.X_BH().translation_m.x()) < 1e-6);

  press(pose, {1e-3, 0, 0}, 5000);
  press(pose, {-0.2e-3, 0, 0}, 40);  // slightly reversed: at 0.5 m/s 10 mm take 20 ticks
  CHECK(pose.X_BH().translation_m.x() < 0.0);

  press(pose, {1e-3, 0, 0}, 5000);
  press(pose, {0, 1e-3, 0}, 200);  // a deflection along the wall
  CHECK(std::abs(pose.X_BH().translation_m.x()) < 1e-6);
  CHECK(pose.X_BH().translation_m.y() > 0.01);

  DeflectionPose free = pose_of([] {
    Deflection d = steered();
    d.max_proxy_distance_m = d.max_proxy_angle_rad = Deflection::kNotStated;
    return d;
  }());
  press(free, {1e-3, 0, 0}, 5000);
  CHECK(free.X_BH().translation_m.x() == Approx(0.2));  // the reach of the profile
}

TEST_CASE("at a wall that blocks rotation the angle to the proxy stays within its limit",
          "[deflection_pose]") {
  DeflectionPose pose = pose_of(steered());
  pose.set_proxy_pose(Pose{});
  pose.set_deflection(Vector3d::Zero(), {0, 0, 0.1});
  for (int i = 0; i < 5000; ++i) pose.advance(kTick_s);
  CHECK(rotation_vector(pose.X_BH().rotation).z() == Approx(0.2).epsilon(0.02));
  pose.set_deflection(Vector3d::Zero(), Vector3d::Zero());
  for (int i = 0; i < 50; ++i) pose.advance(kTick_s);
  CHECK(rotation_vector(pose.X_BH().rotation).norm() < 1e-5);
}

TEST_CASE("the pose respects speed limits and box for any deflection and proxy pose", "[deflection_pose]") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const auto vector = [&](double size) {
    return Vector3d(size * Vector3d(any(random), any(random), any(random)));
  };
  Deflection settings = steered();
  settings.reach_m = Deflection::kUnbounded;
  settings.box_min_m = {-0.01, -0.02, -0.03};
  settings.box_max_m = {0.02, 0.03, 0.0};
  DeflectionPose pose = pose_of(settings);
  double farthest_m = 0.0;
  for (int i = 0; i < 100000; ++i) {
    if (i % 7 == 0) pose.set_deflection(vector(2e-3), vector(0.2));
    if (i % 11 == 0) pose.set_proxy_pose(Pose{rotation_from(vector(3.0)), vector(0.1)});
    if (i % 101 == 0) pose.set_proxy_pose({});
    const Pose before = pose.X_BH();
    pose.advance(kTick_s);
    const Vector3d step = pose.X_BH().translation_m - before.translation_m;
    REQUIRE(step.norm() <= kTick_s * kFastest_m_per_s * (1 + 1e-9));
    REQUIRE(before.rotation.angularDistance(pose.X_BH().rotation) <=
            kTick_s * kFastest_rad_per_s * (1 + 1e-6));
    REQUIRE((step / kTick_s - pose.V_BH().linear_m_per_s).norm() < 1e-9);
    REQUIRE((pose.X_BH().translation_m - settings.box_min_m).minCoeff() >= 0.0);
    REQUIRE((settings.box_max_m - pose.X_BH().translation_m).minCoeff() >= 0.0);
    farthest_m = std::max(farthest_m, pose.X_BH().translation_m.norm());
  }
  CHECK(farthest_m > 0.02);
}

TEST_CASE("at rest without contact the proxy distance limit does not change a bit of the pose",
          "[deflection_pose]") {
  DeflectionPose pose = pose_of(steered());
  pose.set_deflection({0.7e-3, 0.3e-3, 0}, {0, 0.05, 0.02});
  for (int i = 0; i < 700; ++i) pose.advance(kTick_s);
  pose.set_deflection(Vector3d::Zero(), Vector3d::Zero());
  const Pose left = pose.X_BH();
  const Pose X_WB{rotation_from({0.4, 1.0, -2.0}), {0.3, -0.2, 1.0}};
  for (int i = 0; i < 1000; ++i) {
    pose.set_proxy_pose(inverse(X_WB) * (X_WB * pose.X_BH()));  // equal except for rounding
    pose.advance(kTick_s);
  }
  CHECK(same_bits(pose.X_BH(), left));
}

// --- in the loop ------------------------------------------------------------------------------------------

TEST_CASE("a tool steered into a table stays within the distance limit and lifts off at once",
          "[deflection_pose][servo]") {
  Steered s;
  s.up_from_the_table();
  s.mouse.set_deflection(kDown);
  double deepest_m = 0.0;
  for (int i = 0; i < 5000; ++i) {
    s.tick();
    REQUIRE(s.fault == Fault::none);
    deepest_m = std::max(deepest_m, s.depth_m());
  }
  CHECK(s.last.contacts > 0);
  CHECK(deepest_m == Approx(0.010).epsilon(0.02));
  CHECK(s.push_up_N() == Approx(6.0).epsilon(0.03));  // 600 N/m
  CHECK(Vector3d(s.last.F_out.data()).norm() == 0.0);

  s.mouse.set_deflection({0, 0, 175, 0, 0, 0});
  s.ticks(1000);
  const double half_m = s.depth_m();
  CHECK(half_m == Approx(0.010 * std::pow((0.5 - 0.08) / 0.92, 2.0)).epsilon(0.05));
  s.mouse.set_deflection({});
  s.ticks(200);
  CHECK(s.depth_m() < 1e-6);
  CHECK(std::abs(s.push_up_N()) < 1e-3);

  s.mouse.set_deflection(kDown);
  s.ticks(2000);
  s.mouse.set_deflection(kUp);
  int ticks = 0;
  for (; s.last.contacts > 0 && ticks < 1000; ++ticks) s.tick();
  CHECK(ticks < 50);  // 16 ms to the next report, 20 ms for the return
}

TEST_CASE("a device without motors needs no arming, and its silence is no permanent fault",
          "[deflection_pose][servo]") {
  Steered s;
  s.up_from_the_table();
  s.mouse.set_deflection(kDown);
  s.ticks(2000);
  CHECK(s.state() == State::disarmed);
  CHECK(s.push_up_N() > 5.0);

  s.runtime->loop().requests().arm();
  s.ticks(3000);
  CHECK(s.state() == State::active);
  s.mouse.stop_sending();
  bool reported = false;
  for (int i = 0; i < 2000; ++i) {
    s.tick();
    REQUIRE_FALSE(is_latched(s.state()));
    reported = reported || (s.last.faults & bit(Fault::sample_late)) != 0;
  }
  CHECK(reported);
  CHECK(s.state() == State::active);
  CHECK(s.depth_m() < 1e-6);  // the puck is released
}

TEST_CASE("the recentre button returns the tool to its initial pose through obstacles",
          "[deflection_pose][servo]") {
  RunConfig plan = shipped_config();
  plan.settings.device.base_in_world.position_m = {0, 0, 0.05};  // half of the cube above the table
  Steered s(plan);
  s.ticks(100);
  const Pose start = pose_in(s.last.X_WQ);
  s.mouse.set_deflection({350, 0, 0, 0, 0, 0});
  s.ticks(1000);
  s.mouse.set_deflection({0, 0, 0, 0, 350, 0});
  s.ticks(1000);
  s.mouse.set_deflection({});
  s.ticks(50);
  REQUIRE((pose_in(s.last.X_WQ).translation_m - start.translation_m).norm() > 0.05);
  s.mouse.set_buttons(1);
  bool search_completed = false;  // and did not move along a path around obstacles
  for (int i = 0; i < 50; ++i) {
    s.tick();
    search_completed = search_completed || static_cast<ProxyInitialization>(s.last.proxy_initialization) ==
                                               ProxyInitialization::found;
  }
  CHECK(search_completed);
  CHECK((pose_in(s.last.X_WQ).translation_m - start.translation_m).norm() < 1e-9);
  CHECK(pose_in(s.last.X_WQ).rotation.angularDistance(start.rotation) < 1e-9);
  CHECK(s.fault == Fault::none);
}

TEST_CASE("a steered session replays with the same bits", "[deflection_pose][replay]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  Steered s;
  {
    RunRecorder recorder(*s.runtime, file);
    s.ticks(300);
    recorder.append_new_ticks();
    s.runtime->loop().requests().arm();
    for (const std::array<int, 6>& push :
         {kUp, kDown, {200, 40, 350, 90, 0, -200}, {}, {0, 300, 0, 350, 0, 0}}) {
      s.mouse.set_deflection(push);
      s.mouse.set_buttons(push == kDown ? 2 : 0);
      s.ticks(1200);
      if (push == kDown) s.mouse.set_buttons(1);
      s.ticks(100);
      recorder.append_new_ticks();
    }
    REQUIRE(recorder.is_complete());
  }
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 6800);
  int pressed = 0;
  for (const TickRecord& tick : recording.ticks) pressed += tick.contacts > 0 ? 1 : 0;
  CHECK(pressed > 1000);
  const auto difference = replay(recording, s.plan);
  if (difference) FAIL("tick " << difference->tick << ' ' << difference->field);
}

TEST_CASE("steering does not allocate or lock", "[deflection_pose][realtime]") {
  Steered s;
  s.up_from_the_table();
  std::uint64_t allocations = 0, locks = 0;
  {
    const RealtimeGuard guard;
    for (int i = 0; i < 6; ++i) {
      s.mouse.set_deflection(i % 2 == 0 ? kDown : kUp);
      s.mouse.set_buttons(i == 4 ? 2 : 0);
      s.ticks(700);
    }
    allocations = guard.allocations();
    locks = guard.locks();
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("the simulated hand observes the displayed tool and steers it along its path",
          "[deflection_pose][simulation]") {
  RunConfig plan = shipped_config();
  plan.profile = load_profile(test::source_path("config/profiles/spacemouse_split.toml"),
                              SearchPath({test::source_path("config")}));
  VirtualClock clock;
  const auto link = make_simulated_link(plan.profile, plan.settings.simulation, clock);
  Runtime runtime(plan, *link, clock, ProxySearchMode::in_tick);
  runtime.open();
  TickRecord last;
  double pressed_m = 0.0, farthest_m = 0.0;
  for (int i = 0; i < 36000; ++i) {  // three times along the path: the penetration does not accumulate
    clock.sleep_until(clock.now() + 1ms);
    REQUIRE(runtime.loop().tick(clock.now(), clock.now()) == Fault::none);
    runtime.loop().telemetry().latest_record().read(last);
    if (i < 2000) continue;  // it starts in the table
    const Pose p = pose_in(last.X_WP), q = pose_in(last.X_WQ);
    pressed_m = std::max(pressed_m, (p.translation_m - q.translation_m).norm());
    const Pose G = link->device().hand_target().X_BG;
    if (i > 24000) farthest_m = std::max(farthest_m, (G.translation_m - p.translation_m).norm());
  }
  CHECK(pressed_m > 0.002);
  CHECK(pressed_m < 0.011);
  CHECK(farthest_m < 0.020);
}

}  // namespace wrenchd::test_deflection_pose
