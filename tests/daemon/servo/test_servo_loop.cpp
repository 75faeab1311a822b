// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <cstring>
#include <memory>
#include <thread>

#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "core/wrench_law.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/live_line.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/links/simulated_link.hpp"
#include "tests/support/buried_tool.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_servo_loop {

using namespace wrenchd::test;

namespace {

/// When the shipped hand is deep in the table, in seconds after power-on.
constexpr double kPressing_s = 2.4;

/// A device whose handle stays at one pose and which delivers a new sample at every tick.
class StillDevice final : public Device {
 public:
  void open() override {}
  DeviceSample read_newest(TimePoint now) noexcept override {
    DeviceSample sample;
    sample.X_BH.translation_m = {0.0, 0.0, 0.1};
    sample.device_time_s = seconds(now.time_since_epoch());
    sample.sequence = ++sequence_;
    sample.arrived = now;
    sample.fresh = true;
    return sample;
  }
  Fault write(TimePoint, const Wrench&, bool) noexcept override { return Fault::none; }
  void release(TimePoint) noexcept override {}
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

 private:
  std::uint64_t sequence_ = 0;
};

/// Finds no feasible pose for any request, and stores the requests.
class RequestStore final : public ProxyInitializer {
 public:
  std::vector<ProxyInitializationRequest> requests;

  void request(const ProxyInitializationRequest& request) noexcept override { requests.push_back(request); }
  bool take_result(ProxyInitializationResult& result) noexcept override {
    result = {requests.back().id, false, Pose{}, requests.back().scene_time_s};
    return true;
  }
};

}  // namespace

TEST_CASE("after every start the loop is disarmed: it measures and projects, and sends zero wrench",
          "[servo]") {
  VirtualRuntime s;
  double most_N = 0.0;
  bool contact = false;
  for (int i = 0; i < 5000; ++i) {
    REQUIRE(s.tick() == Fault::none);
    most_N = std::max({most_N, s.force_N(), s.torque_Nm()});
    contact = contact || s.last.contacts > 0;
    CHECK(s.state() == State::disarmed);
  }
  CHECK(contact);
  CHECK(most_N == 0.0);
  CHECK(s.simulated.motor_wrench().force_N.norm() == 0.0);
}

TEST_CASE("an armed loop renders the table: the simulated hand presses the cube onto it", "[servo]") {
  VirtualRuntime s;
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  CHECK(s.state() == State::active);
  CHECK(s.last.contacts == 4);
  // Pressed flat: the force is K_P times the depth, straight up, and the hand's spring balances it.
  const double depth_m = 0.025 - s.last.X_WP[2];
  CHECK(depth_m > 0.0005);
  CHECK(s.last.F_out[2] == Approx(600.0 * depth_m).epsilon(0.02));
  CHECK(std::hypot(s.last.F_out[0], s.last.F_out[1]) < 1e-3);
  CHECK(s.simulated.handle().hand_wrench().force_N.z() == Approx(-s.last.F_out[2]).epsilon(0.05));
  CHECK(pose_from_numbers(s.last.X_WQ).translation_m.z() == Approx(0.025).margin(1e-12));
}

TEST_CASE("the wrench sent is that of Eq. (16), about the handle in the axes of the base", "[servo]") {
  RunConfig plan = shipped_config();
  plan.settings.device.base_in_world = {{0.0, 0.0, 0.0}, {0.0, 0.0, 1.2}};
  plan.settings.device.tool_in_handle = {{0.01, -0.02, 0.0}, {0.0, 0.3, 0.0}};
  plan.settings.wrench.law = SpringLaw::pid;
  plan.settings.wrench.gains.damping.setZero();
  const Matrix6d K = plan.settings.wrench.gains.stiffness;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  int compared = 0;
  for (int i = 0; i < 8000; ++i) {
    REQUIRE(s.tick() == Fault::none);
    if (s.state() != State::active || s.last.limit_causes != kNotLimited || s.last.contacts == 0) continue;
    const Pose X_WP = pose_from_numbers(s.last.X_WP);
    const Vector6d eps = log(inverse(X_WP) * pose_from_numbers(s.last.X_WQ));
    const Vector6d W_T = K * eps;
    const Pose X_WB{Quaterniond(Eigen::AngleAxisd(1.2, Vector3d::UnitZ())), Vector3d::Zero()};
    const Pose X_WH = X_WB * pose_from_numbers(s.last.X_BH);
    const Vector3d f_W = X_WP.rotation * W_T.head<3>();
    const Vector3d t_W = X_WP.rotation * W_T.tail<3>() + (X_WP.translation_m - X_WH.translation_m).cross(f_W);
    const Vector3d f_B = X_WB.rotation.conjugate() * f_W;
    const Vector3d t_B = X_WB.rotation.conjugate() * t_W;
    CHECK((f_B - Vector3d(s.last.F_out[0], s.last.F_out[1], s.last.F_out[2])).norm() < 1e-9);
    CHECK((t_B - Vector3d(s.last.F_out[3], s.last.F_out[4], s.last.F_out[5])).norm() < 1e-9);
    ++compared;
  }
  CHECK(compared > 1000);
}

TEST_CASE("a device without rotational motors renders force; the loop drops the torque and reports it",
          "[servo]") {
  RunConfig plan = shipped_config();
  plan.profile = load_profile(test::source_path("config/profiles/polhem.toml"),
                              SearchPath({test::source_path("config")}));
  VirtualClock clock;
  const auto link = make_simulated_link(plan.profile, plan.settings.simulation, clock);
  Runtime runtime(plan, *link, clock, ProxySearchMode::in_tick);
  runtime.open();
  runtime.loop().requests().arm();
  TickRecord last;
  bool pushed = false, reported = false;
  for (int i = 0; i < 5000; ++i) {
    clock.sleep_until(clock.now() + std::chrono::milliseconds(1));
    REQUIRE(runtime.loop().tick(clock.now(), clock.now()) == Fault::none);
    runtime.loop().telemetry().latest_record().read(last);
    CHECK(Vector3d(last.F_out[3], last.F_out[4], last.F_out[5]).norm() == 0.0);
    CHECK((last.limit_causes & kTorqueMagnitude) == 0);
    CHECK((last.undriven_dofs & ~kAngularDofs) == 0);
    pushed = pushed || last.F_out[2] > 0.5;
    reported =
        reported || live_line(last, runtime.loop().telemetry().timing()).find("(no motor: rx ry rz)") !=
                        std::string::npos;
  }
  CHECK(static_cast<State>(last.state) == State::active);
  CHECK(pushed);
  CHECK(reported);
}

TEST_CASE("an armed loop compensates the weight of the handle at every tilt of the base", "[servo]") {
  const double tilt_rad = GENERATE(0.0, 0.7);
  RunConfig plan = shipped_config();
  plan.settings.simulation.hand_path = {{0.0, {0, 0, 0.06}, {0, 0.4, 0}}};  // far from the table
  plan.settings.device.base_in_world = {{0, 0, 0.05}, {tilt_rad, 0, 0}};
  plan.profile.masses = {0.2, {0.03, 0, 0}, 0.1};
  const GravityCompensation gravity(plan.profile.masses, rotation_from({tilt_rad, 0, 0}));
  VirtualRuntime s(plan);
  REQUIRE(s.run(0.2) == Fault::none);
  CHECK(s.force_N() == 0.0);  // disarmed
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(3.0) == Fault::none);
  REQUIRE(s.state() == State::active);
  CHECK(s.last.contacts == 0);
  const Wrench weight = gravity.wrench(pose_from_numbers(s.last.X_BH));
  CHECK(weight.force_N.norm() == Approx(0.3 * kGravity_m_per_s2));
  CHECK((weight.force_N - Vector3d(s.last.F_out[0], s.last.F_out[1], s.last.F_out[2])).norm() < 1e-12);
  CHECK((weight.torque_Nm - Vector3d(s.last.F_out[3], s.last.F_out[4], s.last.F_out[5])).norm() < 1e-12);
  CHECK(weight.torque_Nm.norm() > 0.01);
}

TEST_CASE("a profile can select the paper's spatial wrench about the world origin", "[servo]") {
  RunConfig plan = shipped_config();
  plan.profile.wrench_point = WrenchPoint::world_origin;
  plan.settings.wrench.gains.damping.setZero();
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s + 0.6) == Fault::none);
  REQUIRE(s.last.contacts > 0);
  const Wrench W_T{{s.last.F_T[0], s.last.F_T[1], s.last.F_T[2]},
                   {s.last.F_T[3], s.last.F_T[4], s.last.F_T[5]}};
  const Wrench W_S = spatial_wrench(pose_from_numbers(s.last.X_WP), W_T);
  CHECK((W_S.force_N - Vector3d(s.last.F_out[0], s.last.F_out[1], s.last.F_out[2])).norm() < 1e-9);
  CHECK((W_S.torque_Nm - Vector3d(s.last.F_out[3], s.last.F_out[4], s.last.F_out[5])).norm() < 1e-9);
}

TEST_CASE("arming in contact waits: no force until the hand has left the contact and is at rest", "[servo]") {
  VirtualRuntime s;
  REQUIRE(s.run(kPressing_s) == Fault::none);
  REQUIRE(s.last.contacts > 0);
  s.runtime.loop().requests().arm();
  for (int i = 0; i < 300; ++i) {
    REQUIRE(s.tick() == Fault::none);
    CHECK(s.state() == State::waiting);
    CHECK(s.force_N() == 0.0);
  }
}

TEST_CASE("authority rises over the soft start, and the slew limit bounds the rise of the force", "[servo]") {
  RunConfig plan = shipped_config();
  plan.settings.limits.force_slew_N_per_s = 100.0;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  double last_N = 0.0;
  double last_authority = 0.0;
  for (int i = 0; i < 4000; ++i) {
    REQUIRE(s.tick() == Fault::none);
    CHECK(s.force_N() <= last_N + 0.1 + 1e-9);
    if (s.state() == State::ramping) CHECK(s.last.authority <= last_authority + 0.0011);
    last_N = s.force_N();
    last_authority = s.last.authority;
  }
}

TEST_CASE("a wrench above the limits is scaled to them and keeps its direction", "[servo]") {
  RunConfig plan = shipped_config();
  plan.settings.limits.max_force_N = 0.5;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  CHECK((s.last.limit_causes & kForceMagnitude) != 0);
  CHECK(s.force_N() <= 0.5);
  CHECK(s.force_N() > 0.499);
  CHECK(s.last.F_out[2] > 0.499);
}

TEST_CASE("an unplugged device ends the loop, and the hand is released", "[servo]") {
  VirtualRuntime s;
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  s.inject(SimulatedFault::Kind::unplug, kPressing_s, 1.0);
  CHECK(s.run(4.0) == Fault::device_lost);
  CHECK(s.last.released == 1);
  CHECK(s.last.faults == bit(Fault::device_lost));
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == State::disconnected);
  CHECK(seconds(s.clock.now() - TimePoint{}) < kPressing_s + 0.003);
}

TEST_CASE("a late sample fades the force to zero; when samples return, the force ramps up", "[servo]") {
  VirtualRuntime s;
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  REQUIRE(s.force_N() > 0.5);
  s.inject(SimulatedFault::Kind::silence, kPressing_s, 0.014);
  REQUIRE(s.run(0.010) == Fault::sample_late);
  CHECK(s.state() == State::degraded);
  CHECK(seconds(s.clock.now() - TimePoint{}) < kPressing_s + 0.0062);
  double before_N = s.force_N();
  for (int i = 0; i < 12; ++i) {
    REQUIRE(s.tick() == Fault::none);
    CHECK(s.force_N() <= before_N);
    before_N = s.force_N();
  }
  CHECK(s.force_N() == 0.0);
  REQUIRE(s.run(0.4) == Fault::none);
  CHECK(s.state() == State::active);
  CHECK(s.force_N() > 0.5);
}

TEST_CASE("after a stall of the loop the force is zero, without a kick", "[servo]") {
  const bool required = GENERATE(true, false);
  RunConfig plan = shipped_config();
  plan.settings.servo.realtime = required ? Realtime::required : Realtime::best_effort;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  REQUIRE(s.force_N() > 0.5);
  CHECK(s.tick_after(std::chrono::milliseconds(300)) == (required ? Fault::loop_stalled : Fault::tick_late));
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == (required ? State::fault : State::degraded));
  REQUIRE(s.tick() == Fault::none);
  CHECK(s.force_N() == 0.0);
}

TEST_CASE("a hand that starts deep inside an obstacle gets zero force until it has left, and then no kick",
          "[servo][proxy_initialization]") {
  // Inside the boulder, out of it, and back against it.
  const BuriedTool buried(
      {{0.0, {0, 0, 0.03}}, {0.4, {0, 0, 0.03}}, {1.2, {0, 0, 0.12}}, {1.8, {0, 0, 0.075}}});
  const ProxySearchMode search_mode = GENERATE(ProxySearchMode::in_tick, ProxySearchMode::background);
  VirtualRuntime s(buried.config, search_mode);
  FeasiblePoseSearch search(s.runtime.scene());
  const double slew_N = buried.config.settings.limits.force_slew_N_per_s * 1e-3;
  const double most_N = buried.config.profile.max_force_N;
  s.runtime.loop().requests().arm();
  REQUIRE(s.tick() == Fault::none);
  CHECK(proxy_initialization(s) == ProxyInitialization::searching);
  int searching_ticks = 0;
  double last_N = 0.0, last_authority = 0.0;
  bool waited = false, ramped = false;
  for (const TimePoint end = s.clock.now() + from_seconds(4.0); s.clock.now() < end;) {
    if (search_mode == ProxySearchMode::background) wait_for_proxy_search(s);
    REQUIRE(s.tick() == Fault::none);
    if (proxy_initialization(s) != ProxyInitialization::complete) {
      CHECK(s.force_N() == 0.0);
      CHECK(s.torque_Nm() == 0.0);
      CHECK(s.last.contacts == 0);
      CHECK(s.state() == State::waiting);
    }
    if (proxy_initialization(s) == ProxyInitialization::searching) {
      CHECK(std::isnan(s.last.X_WQ[0]));
      CHECK(std::isnan(s.last.energy));
      ++searching_ticks;
      continue;
    }
    if (s.last.tick % 10 == 0) CHECK(search.admissible(pose_from_numbers(s.last.X_WQ)));
    waited = waited || s.state() == State::waiting;
    ramped = ramped || s.state() == State::ramping;
    CHECK(s.force_N() <= last_N + slew_N + 1e-9);
    CHECK(s.force_N() <= s.last.authority * most_N + 1e-9);
    CHECK(s.last.authority <= last_authority + 0.0011);
    last_N = s.force_N();
    last_authority = s.last.authority;
  }
  CHECK(searching_ticks >= 1);
  CHECK(waited);
  CHECK(ramped);
  CHECK(s.state() == State::active);
  CHECK(s.last.contacts > 0);
  CHECK(s.last.F_out[2] > 0.5);
}

TEST_CASE("while the hand stays inside an obstacle, the proxy is at a feasible pose and the force is zero",
          "[servo][proxy_initialization]") {
  const BuriedTool buried({{0.0, {0, 0, 0.03}}});
  VirtualRuntime s(buried.config);
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(0.5) == Fault::none);
  CHECK(proxy_initialization(s) == ProxyInitialization::complete);
  CHECK(s.last.contacts > 0);
  CHECK(FeasiblePoseSearch(s.runtime.scene()).admissible(pose_from_numbers(s.last.X_WQ)));
  CHECK(s.last.energy > 0.0);
  CHECK(s.state() == State::waiting);
  CHECK(s.force_N() == 0.0);
}

TEST_CASE("if the tool does not fit, the force is zero; the failure is reported once and the search repeats",
          "[servo][proxy_initialization]") {
  RunConfig plan = shipped_config();
  plan.scene.half_spaces = closed_box(0.02);  // the cube's half edge is 25 mm
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  int failed_searches = 0;
  for (int i = 0; i < 1000; ++i) {
    const ProxyInitialization before = proxy_initialization(s);
    REQUIRE(s.tick() == Fault::none);
    CHECK((proxy_initialization(s) == ProxyInitialization::searching ||
           proxy_initialization(s) == ProxyInitialization::failed));
    CHECK(std::isnan(s.last.X_WQ[0]));
    CHECK(s.force_N() == 0.0);
    CHECK(s.state() == State::waiting);
    failed_searches +=
        before == ProxyInitialization::searching && proxy_initialization(s) == ProxyInitialization::failed
            ? 1
            : 0;
  }
  CHECK(failed_searches >= 9);  // ten times a second
  CHECK(failed_searches <= 11);
  int failures = 0;
  for (Event event; s.runtime.loop().telemetry().events().pop(event);) {
    failures += std::holds_alternative<Event::ProxySearchFailed>(event.data) ? 1 : 0;
    CHECK_FALSE(std::holds_alternative<Event::ProxyFound>(event.data));
    CHECK_FALSE(std::holds_alternative<Event::ProjectionInfeasible>(event.data));
  }
  CHECK(failures == 1);
}

TEST_CASE("reinitialization of the proxy sets the force to zero at once; the soft start restores it",
          "[servo][proxy_initialization]") {
  VirtualRuntime s;
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  REQUIRE(s.force_N() > 0.5);
  s.runtime.loop().requests().reinitialize_proxy();
  REQUIRE(s.tick() == Fault::none);
  CHECK(s.last.commands == kReinitialize);
  CHECK(proxy_initialization(s) == ProxyInitialization::searching);
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == State::waiting);
  REQUIRE(s.tick() == Fault::none);
  CHECK(s.last.commands == kNoCommand);
  CHECK(proxy_initialization(s) == ProxyInitialization::found);
  CHECK_FALSE(std::isnan(s.last.X_WQ[0]));
  CHECK(s.force_N() == 0.0);
  REQUIRE(s.tick() == Fault::none);
  CHECK(proxy_initialization(s) == ProxyInitialization::complete);
  CHECK(s.last.contacts == 4);
  for (double last_authority = 0.0; s.state() != State::active;) {
    REQUIRE(s.clock.now() < TimePoint{} + std::chrono::seconds(30));
    REQUIRE(s.tick() == Fault::none);
    CHECK(s.force_N() <= s.last.authority * s.runtime.config().profile.max_force_N);
    CHECK(s.last.authority <= last_authority + 0.0011);
    last_authority = s.last.authority;
  }
}

TEST_CASE("arming during the search for a feasible pose does not restart the search",
          "[servo][proxy_initialization]") {
  const auto ticks_until_found = [](int armed_at) {
    VirtualRuntime s;
    int ticks = 0;
    for (; ticks < 100 && proxy_initialization(s) != ProxyInitialization::found; ++ticks) {
      if (ticks == armed_at) s.runtime.loop().requests().arm();
      REQUIRE(s.tick() == Fault::none);
    }
    return ticks;
  };
  const int without = ticks_until_found(-1);
  CHECK(without < 10);
  CHECK(ticks_until_found(without - 1) == without);
}

TEST_CASE("obstacles that the hand passes through while disarmed do not hold the tool after arming",
          "[servo][proxy_initialization]") {
  // Disarmed, from above the boulder through it.
  const BuriedTool buried({{0.0, {0, 0, 0.12}}, {1.0, {0, 0, -0.12}}});
  VirtualRuntime s(buried.config);
  REQUIRE(s.run(1.5) == Fault::none);
  CHECK(s.last.X_WP[2] < -0.11);
  CHECK(s.last.X_WQ[2] > 0.05);  // the proxy stays on its side of the boulder
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(1.5) == Fault::none);
  CHECK(s.state() == State::active);
  CHECK(s.last.contacts == 0);
  CHECK(s.last.X_WQ == s.last.X_WP);
}

TEST_CASE("a stop during proxy initialization ends the loop and the search",
          "[servo][proxy_initialization]") {
  const BuriedTool buried({{0.0, {0, 0, 0.03}}}, 100000);
  auto s = std::make_unique<SimulatedRuntime<WallClock>>(buried.config);
  WallClock& clock = s->clock;
  std::atomic<bool> stop{false};
  Fault fault = Fault::none;
  std::thread servo([&] { fault = s->runtime.loop().run(clock, stop); });
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  stop.store(true);
  servo.join();
  TickRecord last;
  REQUIRE(s->runtime.loop().telemetry().latest_record().read(last));
  CHECK(fault == Fault::none);
  CHECK(last.released == 1);
  CHECK(static_cast<ProxyInitialization>(last.proxy_initialization) == ProxyInitialization::searching);
  const TimePoint stopped = clock.now();
  s.reset();
  CHECK(WallClock().now() - stopped < std::chrono::seconds(1));  // milliseconds on an idle machine
}

TEST_CASE("without a new sample the progress of the proxy initialization does not change",
          "[servo][proxy_initialization]") {
  const BuriedTool buried({{0.0, {0, 0, 0.03}}});
  VirtualRuntime s(buried.config);
  REQUIRE(s.run(0.1) == Fault::none);
  s.runtime.loop().requests().reinitialize_proxy();
  s.inject(SimulatedFault::Kind::silence, 0.1, 0.008);
  while (proxy_initialization(s) == ProxyInitialization::complete) REQUIRE(s.tick() == Fault::none);
  for (int i = 0; i < 5; ++i) {
    const ProxyInitialization before = proxy_initialization(s);
    REQUIRE(s.tick() == Fault::none);
    if (s.last.fresh == 0) CHECK(proxy_initialization(s) == before);
    CHECK(s.force_N() == 0.0);
  }
  REQUIRE(s.run(0.05) == Fault::none);
  CHECK(proxy_initialization(s) == ProxyInitialization::complete);
}

TEST_CASE("stop, acknowledge and arm requested for the same tick have the effect of stop", "[servo]") {
  VirtualRuntime s;
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  s.runtime.loop().requests().request(kStop | kAcknowledge | kArm);
  CHECK(s.tick() == Fault::stop_requested);
  CHECK(s.state() == State::stopped);
  CHECK(s.force_N() == 0.0);
}

TEST_CASE("release() may be called at any time, and repeatedly", "[servo]") {
  VirtualRuntime s;
  s.runtime.loop().release(s.clock.now());
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  for (int i = 0; i < 3; ++i) {
    s.runtime.loop().release(s.clock.now());
    CHECK(s.runtime.loop().telemetry().state() == State::shutdown);
  }
  CHECK(s.run(0.1) == Fault::none);
  CHECK(s.simulated.motor_wrench().force_N.norm() == 0.0);
  CHECK(s.force_N() == 0.0);
  CHECK(s.state() == State::disarmed);
}

TEST_CASE("scene time begins at the first tick and advances with the tick times in every state",
          "[servo][moving]") {
  const RunConfig plan = shipped_config();
  StillDevice device;
  VirtualClock clock;
  const auto scene = std::make_shared<const Scene>(plan.scene);
  const auto initializer = std::make_shared<RequestStore>();
  ServoLoop loop(plan.settings, plan.profile, device,
                 std::make_unique<Rendering>(0, plan.settings, plan.profile, scene, initializer), clock);
  const TimePoint first{from_seconds(123456.789)};  // 34 h after the machine started
  std::vector<double> expected_s;
  TimePoint now = first;
  for (int i = 0; i < 3000; ++i) {
    if (i == 700) loop.requests().arm();
    if (i == 1200) loop.requests().disarm();
    if (i == 1500) loop.requests().reinitialize_proxy();
    if (i == 2000) loop.release(now);
    const Fault fault = loop.tick(now, now);
    REQUIRE((fault == Fault::none || (i == 1001 && fault == Fault::loop_stalled)));
    if (initializer->requests.size() > expected_s.size()) expected_s.push_back(seconds(now - first));
    now += i == 1000 ? std::chrono::seconds(5) : from_seconds(0.00098 + 0.00001 * (i % 5));
  }
  REQUIRE(expected_s.size() > 20);
  CHECK(expected_s.front() == 0.0);
  CHECK(expected_s.back() == Approx(8.0).margin(0.2));
  REQUIRE(initializer->requests.size() == expected_s.size());
  for (std::size_t i = 0; i < expected_s.size(); ++i)
    CHECK(initializer->requests[i].scene_time_s == expected_s[i]);
}

TEST_CASE("a plunger that rises from the table lifts and tilts the cube", "[servo][moving]") {
  RunConfig plan = shipped_config();
  plan.scene = load_scene(test::source_path("config/scenes/cube_over_plunger.toml"));
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  double most_tilt = 0.0, most_lift_m = 0.0;
  for (int i = 0; i < 6000; ++i) {
    REQUIRE(s.tick() == Fault::none);
    if (proxy_initialization(s) != ProxyInitialization::complete) continue;
    const Pose X_WQ = pose_from_numbers(s.last.X_WQ);
    const double down = X_WQ.translation_m.z() - 0.025;  // height above a cube on the table
    if (s.last.contacts > 0) most_lift_m = std::max(most_lift_m, down);
    most_tilt = std::max(most_tilt, std::abs(X_WQ.rotation.y()));
  }
  CHECK(most_lift_m > 0.003);
  CHECK(most_tilt > 0.02);
}

// The passivity guard credits the work of a moving obstacle. Without the credit it would remove this energy.
TEST_CASE("the guard does not scale the force of a plunger that presses against a hand at rest",
          "[servo][moving]") {
  RunConfig plan = shipped_config();
  plan.scene = load_scene(test::source_path("config/scenes/cube_over_plunger.toml"));
  plan.settings.simulation.hand_path = {{0.0, {0.0, 0.0, 0.026}, Vector3d::Zero()}};
  plan.settings.simulation.hand_repeats = false;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  double min_scale = 1.0, most_N = 0.0, worst_J = 0.0, gave_J = 0.0;
  for (int i = 0; i < 20000; ++i) {
    REQUIRE(s.tick() == Fault::none);
    min_scale = std::min(min_scale, s.last.passivity_scale);
    most_N = std::max(most_N, s.force_N());
    worst_J = std::max(worst_J, s.last.injected_J);
    gave_J = s.last.energy_out_J;
  }
  CHECK(most_N > 1.0);
  CHECK(gave_J > 1e-3);
  CHECK(min_scale == 1.0);
  CHECK(worst_J < 1e-5);
}

TEST_CASE("two runs in virtual time are equal bit for bit", "[servo]") {
  VirtualRuntime a;
  VirtualRuntime b;
  a.runtime.loop().requests().arm();
  b.runtime.loop().requests().arm();
  for (int i = 0; i < 6000; ++i) {
    REQUIRE(a.tick() == Fault::none);
    REQUIRE(b.tick() == Fault::none);
    REQUIRE(a.last.F_out == b.last.F_out);
    REQUIRE(std::memcmp(&a.last.X_WQ, &b.last.X_WQ, sizeof a.last.X_WQ) == 0);  // NaN if there is no proxy
  }
}

TEST_CASE("all methods render the force of the table", "[servo]") {
  const Method method = GENERATE(Method::exact, Method::planar, Method::descent, Method::translational);
  RunConfig plan = shipped_config();
  plan.settings.rendering.method = method;
  VirtualRuntime s(plan);
  s.runtime.loop().requests().arm();
  REQUIRE(s.run(kPressing_s) == Fault::none);
  // The traditional penalty generates energy while the cube tips onto its face, and the guard removes the
  // energy.
  const bool gives_energy = method == Method::translational || method == Method::planar;
  if (gives_energy) CHECK((s.last.F_out[2] > 0.5 || (s.last.limit_causes & kPassivity) != 0));
  if (!gives_energy) CHECK(s.last.F_out[2] > 0.5);
  REQUIRE(s.run(1.0) == Fault::none);
}

TEST_CASE("in wall time the loop runs at its rate, paced by the clock or by the device, and stops on request",
          "[servo]") {
  const Pacing pacing = GENERATE(Pacing::clock, Pacing::device);
  RunConfig plan = shipped_config();
  plan.settings.servo.pacing = pacing;
  SimulatedRuntime<WallClock> s(plan);
  WallClock& clock = s.clock;
  Runtime& runtime = s.runtime;
  runtime.loop().requests().arm();
  std::atomic<bool> stop{false};
  Fault fault = Fault::none;
  std::thread servo([&] { fault = runtime.loop().run(clock, stop); });
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  stop.store(true);
  servo.join();
  TickRecord last;
  REQUIRE(runtime.loop().telemetry().latest_record().read(last));
  CHECK(fault == Fault::none);
  CHECK(last.released == 1);
  CHECK(runtime.loop().telemetry().timing().tick.count() > 10);
  CHECK(runtime.loop().telemetry().timing().tick.count() <= 600);  // with the fade
}

}  // namespace wrenchd::test_servo_loop
