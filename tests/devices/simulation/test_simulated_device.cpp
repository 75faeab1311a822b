// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_device.hpp"

namespace wrenchd::test_simulated_device {

using namespace std::chrono_literals;

namespace {

using Kind = SimulatedFault::Kind;

/// A hand that moves down, rotates and returns within two seconds.
SimulationSettings moving_hand() {
  SimulationSettings s;
  s.hand_path = {{0.0, {0.0, 0.0, 0.05}, {0, 0, 0}},
                 {0.8, {0.02, 0.01, -0.02}, {0.3, 0.0, 0.1}},
                 {1.2, {0.02, -0.01, -0.02}, {0.3, 0.2, 0.0}},
                 {2.0, {0.0, 0.0, 0.05}, {0, 0, 0}}};
  return s;
}

SimulationSettings still_hand() {
  SimulationSettings s;
  s.hand_path = {{0.0, {0.1, 0.2, 0.3}, {0.0, 0.0, 0.5}}};
  return s;
}

/// Returns settings without hand, delay and quantisation: a free body with bearing friction.
SimulationSettings without_hand() {
  SimulationSettings s = still_hand();
  s.hand_stiffness_N_per_m = s.hand_stiffness_Nm_per_rad = 0.0;
  s.hand_damping_N_s_per_m = s.hand_damping_Nm_s_per_rad = 0.0;
  s.report_delay_s = s.command_delay_s = 0.0;
  return s;
}

/// The whole stack in virtual time.
struct Rig {
  explicit Rig(const SimulationSettings& settings, const DeviceProfile& profile = reference_profile())
      : simulation(profile, settings), link(simulation, clock, settings), device(profile, link) {
    device.open();
    device.read_newest(clock.now());  // the first read only discards waiting reports
  }
  /// Reads until the device is trusted: before that, nothing is written to it.
  void trust() {
    while (!device.trusted()) read_after(1ms);
  }
  DeviceSample read_after(Duration wait) {
    clock.sleep_until(clock.now() + wait);
    return device.read_newest(clock.now());
  }
  Fault write(const Wrench& F, bool motors_on = true) { return device.write(clock.now(), F, motors_on); }

  VirtualClock clock;
  SimulatedDevice simulation;
  LoopbackLink link;
  ProfileDevice device;
};

/// Stores each report with its time.
struct Listener final : ReportSink {
  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override {
    times.push_back(sent);
    bytes.insert(bytes.end(), report.begin(), report.end());
  }
  std::vector<TimePoint> times;
  std::vector<std::uint8_t> bytes;
};

std::vector<std::uint8_t> command(std::uint32_t sequence, const Wrench& F = {}, double hold_s = 0.008,
                                  bool enable = true) {
  const WrenchReportLayout layout = reference_profile().wrench_report;
  std::vector<std::uint8_t> bytes(layout.length);
  encode(layout, WrenchReport{F, hold_s, sequence, enable}, bytes);
  return bytes;
}

Waypoint at_time(double time_s) {
  return {time_s, Vector3d::Zero(), Vector3d::Zero()};
}

const Wrench kPush{{3.0, -1.0, 2.0}, {0.05, 0.0, -0.1}};

}  // namespace

TEST_CASE("the hand path passes through its waypoints, at rest, and has no jumps") {
  const SimulationSettings s = moving_hand();
  const HandPath path(s.hand_path, true);
  for (const Waypoint& w : s.hand_path) {
    const HandTarget target = path.at(from_seconds(w.time_s));
    CHECK((target.X_BG.translation_m - w.position_m).norm() < 1e-12);
    CHECK(target.X_BG.rotation.angularDistance(rotation_from(w.rotation_vector_rad)) < 1e-7);
    CHECK(target.V_BG.linear_m_per_s.norm() < 1e-9);
  }
  for (Duration t{}; t < 4s; t += 1ms) {
    const HandTarget a = path.at(t), b = path.at(t + 1ms);
    REQUIRE((b.X_BG.translation_m - a.X_BG.translation_m).norm() < 3e-4);
    REQUIRE(b.X_BG.rotation.angularDistance(a.X_BG.rotation) < 2e-3);
  }
}

TEST_CASE("the hand path's velocity is the derivative of its pose") {
  const HandPath path(moving_hand().hand_path, true);
  for (Duration t = 1ms; t < 2s; t += 7ms) {
    const HandTarget before = path.at(t - 10us), now = path.at(t), after = path.at(t + 10us);
    const Vector3d v = (after.X_BG.translation_m - before.X_BG.translation_m) / 20e-6;
    const Vector3d w = rotation_vector(after.X_BG.rotation * before.X_BG.rotation.conjugate()) / 20e-6;
    REQUIRE((v - now.V_BG.linear_m_per_s).norm() < 1e-4);
    REQUIRE((w - now.V_BG.angular_rad_per_s).norm() < 1e-4);
  }
}

TEST_CASE("the hand path repeats for days, or stays at its end") {
  const HandPath repeats(moving_hand().hand_path, true);
  const HandTarget a = repeats.at(700ms), b = repeats.at(700ms + 24h);
  CHECK(a.X_BG.translation_m == b.X_BG.translation_m);
  CHECK(a.X_BG.rotation.coeffs() == b.X_BG.rotation.coeffs());
  const HandPath once({{0.0, {0, 0, 0}, {0, 0, 0}}, {1.0, {0.1, 0, 0}, {0, 0, 1}}}, false);
  CHECK(once.at(24h).X_BG.translation_m.x() == Approx(0.1));
  CHECK(once.at(24h).V_BG.linear_m_per_s.norm() == 0.0);
}

TEST_CASE("an invalid hand path is rejected") {
  using Catch::Contains;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(HandPath({}, true), Contains("at least one"));
  CHECK_THROWS_WITH(HandPath({at_time(0.5)}, true), Contains("time 0"));
  CHECK_THROWS_WITH(HandPath({at_time(0.0), at_time(0.0)}, false), Contains("waypoint 2"));
  CHECK_THROWS_WITH(HandPath({at_time(0.0), at_time(nan)}, false), Contains("not finite"));
  const std::vector<Waypoint> open_path = {{0.0, {0, 0, 0}, {0, 0, 0}}, {1.0, {0, 0, 1e-6}, {0, 0, 0}}};
  CHECK_THROWS_WITH(HandPath(open_path, true), Contains("end at its start"));
  CHECK_NOTHROW(HandPath(open_path, false));
}

TEST_CASE("invalid simulation settings are rejected") {
  using Catch::Contains;
  const DeviceProfile profile = reference_profile();
  SimulationSettings s = still_hand();
  s.handle_mass_kg = 0.0;
  CHECK_THROWS_WITH(SimulatedDevice(profile, s), Contains("translation") && Contains("inertia"));
  s = still_hand();
  s.hand_stiffness_Nm_per_rad = 1e6;
  CHECK_THROWS_WITH(SimulatedDevice(profile, s), Contains("rotation") && Contains("too stiff"));
  s = still_hand();
  s.coulomb_friction_N = -1.0;
  CHECK_THROWS_WITH(SimulatedDevice(profile, s), Contains("friction"));
}

TEST_CASE("the device starts at rest at the first waypoint and stays there") {
  Rig rig(still_hand());
  for (int i = 0; i < 100; ++i) rig.read_after(1ms);
  CHECK((rig.simulation.X_BH().translation_m - Vector3d(0.1, 0.2, 0.3)).norm() < 1e-12);
  const DeviceSample sample = rig.read_after(1ms);
  CHECK((sample.X_BH.translation_m - Vector3d(0.1, 0.2, 0.3)).norm() < 1e-6);
  CHECK((rotation_vector(sample.X_BH.rotation) - Vector3d(0, 0, 0.5)).norm() < 1e-6);
  CHECK(sample.V_BH.linear_m_per_s.norm() < 1e-9);
}

TEST_CASE("one report a millisecond, after its delay, none lost") {
  Rig rig(moving_hand());
  DeviceSample sample = rig.read_after(1ms);
  CHECK_FALSE(sample.fresh);  // sampled at 1 ms, here at 1.2 ms
  for (std::uint64_t i = 1; i <= 3000; ++i) {
    sample = rig.read_after(1ms);
    REQUIRE(sample.fault == Fault::none);
    REQUIRE(sample.fresh);
    REQUIRE(sample.missing + sample.superseded + sample.rejected == 0);
    REQUIRE(sample.sequence == i);
    REQUIRE(sample.device_time_s == Approx(1e-3 * static_cast<double>(i)));
    REQUIRE(sample.arrived == TimePoint{} + i * 1ms + 200us);
  }
}

TEST_CASE("waiting for a report ends when it arrives, or at the deadline") {
  Rig rig(still_hand());
  rig.device.wait_readable(TimePoint{} + 10ms);
  CHECK(rig.clock.now() == TimePoint{} + 1200us);
  rig.device.wait_readable(TimePoint{} + 10ms);
  CHECK(rig.clock.now() == TimePoint{} + 1200us);
  CHECK(rig.device.read_newest(rig.clock.now()).fresh);
  rig.device.wait_readable(TimePoint{} + 2ms);
  CHECK(rig.clock.now() == TimePoint{} + 2ms);
  rig.simulation.inject({Kind::silence, 0ms, 1s});
  rig.device.wait_readable(TimePoint{} + 50ms);
  CHECK(rig.clock.now() == TimePoint{} + 50ms);
}

TEST_CASE("other report rates keep their count and their time") {
  for (const double rate_Hz : {125.0, 500.0, 3000.0, 8000.0}) {
    DeviceProfile profile = reference_profile();
    profile.report_rate_Hz = rate_Hz;
    SimulatedDevice simulation(profile, still_hand());
    Listener host;
    simulation.advance_to({}, host);
    simulation.advance_to(TimePoint{} + 1s, host);
    CAPTURE(rate_Hz);
    CHECK(std::abs(static_cast<double>(host.times.size()) - rate_Hz) <= 1.0);
    CHECK(std::abs(seconds(host.times.back() - host.times.front()) * rate_Hz -
                   static_cast<double>(host.times.size() - 1)) < 0.05);
  }
}

TEST_CASE("equal runs give equal bits, independent of how calls divide the time") {
  const DeviceProfile profile = reference_profile();
  const auto run = [&](Duration cut) {
    SimulatedDevice simulation(profile, moving_hand());
    Listener host;
    simulation.advance_to({}, host);
    std::uint32_t sequence = 0;
    for (Duration t = 5ms; t <= 3s; t += 5ms) {
      while (simulation.now() + cut < TimePoint{} + t) simulation.advance_to(simulation.now() + cut, host);
      simulation.advance_to(TimePoint{} + t, host);
      simulation.take_command(simulation.now(), command(++sequence, kPush));
    }
    return host.bytes;
  };
  const auto whole = run(1s);
  REQUIRE(whole.size() == 3000 * 64);
  CHECK(whole == run(1s));
  CHECK(whole == run(100us));
  CHECK(whole == run(777us));
}

TEST_CASE("a free handle follows the hand") {
  Rig rig(moving_hand());
  double worst_m = 0.0, worst_rad = 0.0, travel_m = 0.0;
  for (int i = 0; i < 4000; ++i) {
    rig.read_after(1ms);
    const Pose X_BG = rig.simulation.hand_target().X_BG, X_BH = rig.simulation.X_BH();
    worst_m = std::max(worst_m, (X_BG.translation_m - X_BH.translation_m).norm());
    worst_rad = std::max(worst_rad, X_BG.rotation.angularDistance(X_BH.rotation));
    travel_m = std::max(travel_m, (X_BH.translation_m - Vector3d(0, 0, 0.05)).norm());
  }
  CHECK(worst_m < 0.002);
  CHECK(worst_rad < 0.01);
  CHECK(travel_m > 0.07);
}

TEST_CASE("a constant wrench moves the hand by force over stiffness") {
  Rig rig(still_hand());
  for (int i = 0; i < 2000; ++i) {
    rig.read_after(1ms);
    REQUIRE(rig.write({{3.0, 0.0, 0.0}, {0.0, 0.0, 0.1}}) == Fault::none);
  }
  const Pose& X = rig.simulation.X_BH();
  CHECK(X.translation_m.x() - 0.1 == Approx(3.0 / 300.0).epsilon(1e-4));
  CHECK(rotation_vector(X.rotation).z() - 0.5 == Approx(0.1 / 2.0).epsilon(1e-3));
}

TEST_CASE("a free body gains the speed that its mass and friction allow") {
  SimulationSettings s = without_hand();
  s.viscous_friction_N_s_per_m = 0.5;
  s.viscous_friction_Nm_s_per_rad = 0.002;
  SimulatedDevice simulation(reference_profile(), s);
  Listener host;
  simulation.advance_to({}, host);
  for (std::uint32_t i = 1; i <= 100; ++i) {
    simulation.take_command(simulation.now(), command(i, {{1.0, 0.0, 0.0}, {0.0, 0.002, 0.0}}));
    simulation.advance_to(TimePoint{} + i * 1ms, host);
  }
  //   v(t) = F/b (1 - exp(-b t/m))
  const double v = 1.0 / 0.5 * (1.0 - std::exp(-0.5 * 0.1 / 0.15));
  const double w = 0.002 / 0.002 * (1.0 - std::exp(-0.002 * 0.1 / 2e-4));
  CHECK(simulation.V_BH().linear_m_per_s.x() == Approx(v).epsilon(1e-3));
  CHECK(simulation.V_BH().angular_rad_per_s.y() == Approx(w).epsilon(1e-3));
}

TEST_CASE("Coulomb friction balances a weaker force and reduces a stronger one") {
  SimulationSettings s = without_hand();
  s.coulomb_friction_N = 0.5;
  s.viscous_friction_N_s_per_m = 0.0;
  SimulatedDevice simulation(reference_profile(), s);
  Listener host;
  simulation.advance_to({}, host);
  std::uint32_t sequence = 0;
  const auto push_for_100_ms = [&](double force_N) {
    for (int i = 0; i < 100; ++i) {
      simulation.take_command(simulation.now(), command(++sequence, {{force_N, 0, 0}, {0, 0, 0}}));
      simulation.advance_to(simulation.now() + 1ms, host);
    }
    return simulation.V_BH().linear_m_per_s.x();
  };
  CHECK(push_for_100_ms(0.49) == 0.0);
  CHECK(push_for_100_ms(0.80) == Approx(0.3 / 0.15 * 0.1).epsilon(1e-3));
}

TEST_CASE("the work of motors and hand equals friction loss plus kinetic energy") {
  Rig rig(moving_hand());
  double most_J = 0.0, worst_J = 0.0;
  for (int i = 0; i < 6000; ++i) {
    rig.read_after(1ms);
    const double t = 1e-3 * i;
    REQUIRE(rig.write({{2 * std::sin(30 * t), std::cos(17 * t), 0.5}, {0.02 * std::cos(9 * t), 0, 0}}) ==
            Fault::none);
    const SimulatedHandle& handle = rig.simulation.handle();
    const SimulatedEnergy& E = handle.energy();
    most_J = std::max(most_J, E.friction_J);
    worst_J = std::max(worst_J, std::abs(E.motors_J + E.hand_J - E.friction_J - handle.kinetic_energy_J()));
  }
  CHECK(most_J > 0.01);
  CHECK(worst_J < 0.01 * most_J);
}

TEST_CASE("the force on the handle never exceeds the actuator limits") {
  SimulationSettings s = still_hand();
  s.actuator_max_force_N = 2.0;
  s.actuator_max_torque_Nm = 0.05;
  Rig rig(s);
  for (int i = 0; i < 50; ++i) {
    rig.read_after(1ms);
    rig.write({{6.0, 8.0, 0.0}, {0.0, 0.0, 0.3}});
  }
  CHECK((rig.simulation.motor_wrench().force_N - Vector3d(1.2, 1.6, 0.0)).norm() < 1e-6);
  CHECK((rig.simulation.motor_wrench().torque_Nm - Vector3d(0.0, 0.0, 0.05)).norm() < 1e-6);
}

TEST_CASE("a spatial wrench about the world origin acts like the equivalent handle wrench") {
  const auto run = [](WrenchPoint point) {
    DeviceProfile profile = reference_profile();
    profile.wrench_point = point;
    Rig rig(still_hand(), profile);
    for (int i = 0; i < 300; ++i) {
      rig.read_after(1ms);
      const Wrench F{{1.0, 0.0, 0.5}, {0.0, 0.01, 0.0}};
      const Vector3d p_BH = rig.simulation.X_BH().translation_m;
      rig.write(point == WrenchPoint::handle ? F : shifted(F, -p_BH));
    }
    return rig.simulation.X_BH();
  };
  const Pose a = run(WrenchPoint::handle), b = run(WrenchPoint::world_origin);
  CHECK((a.translation_m - b.translation_m).norm() < 1e-5);
  CHECK(a.rotation.angularDistance(b.rotation) < 1e-3);
}

TEST_CASE("encoders report whole quanta, within half a quantum of the pose") {
  SimulationSettings s = moving_hand();
  s.report_delay_s = 0.0;
  s.position_quantum_m = 1e-4;
  s.rotation_quantum_rad = 1e-3;
  Rig rig(s);
  for (int i = 0; i < 2000; ++i) {
    const DeviceSample sample = rig.read_after(1ms);
    const Vector3d steps = sample.X_BH.translation_m / s.position_quantum_m;
    REQUIRE((steps - steps.array().round().matrix()).norm() < 0.01);
    REQUIRE((sample.X_BH.translation_m - rig.simulation.X_BH().translation_m).cwiseAbs().maxCoeff() <
            0.51e-4);
    const Vector3d turn = rotation_vector(sample.X_BH.rotation) / s.rotation_quantum_rad;
    REQUIRE((turn - turn.array().round().matrix()).norm() < 0.01);
    REQUIRE(sample.X_BH.rotation.angularDistance(rig.simulation.X_BH().rotation) < 1.0e-3);
  }
}

TEST_CASE("the firmware's velocity follows the true one through quanta and filter") {
  Rig rig(moving_hand());
  double worst_v = 0.0, worst_w = 0.0, fastest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const DeviceSample sample = rig.read_after(1ms);
    const Twist& V = rig.simulation.V_BH();
    worst_v = std::max(worst_v, (sample.V_BH.linear_m_per_s - V.linear_m_per_s).norm());
    worst_w = std::max(worst_w, (sample.V_BH.angular_rad_per_s - V.angular_rad_per_s).norm());
    fastest = std::max(fastest, V.linear_m_per_s.norm());
  }
  CHECK(fastest > 0.15);
  CHECK(worst_v < 0.02);
  CHECK(worst_w < 0.15);
  CHECK(worst_v > 0.0);
}

TEST_CASE("the watchdog releases the hand within the hold time of the last command") {
  for (const double hold_s : {0.001, 0.008, 0.031, 1.0, 0.0}) {
    SimulationSettings s = still_hand();
    s.command_delay_s = 0.0;
    DeviceProfile profile = reference_profile();
    SimulatedDevice simulation(profile, s);
    Listener host;
    simulation.advance_to({}, host);
    simulation.take_command(simulation.now(), command(1, kPush, hold_s));
    const double expected_s = hold_s == 0.0 ? profile.watchdog_s : std::min(hold_s, 0.032);
    const TimePoint end = TimePoint{} + from_seconds(expected_s);
    CAPTURE(hold_s);
    simulation.advance_to(end - 100us, host);
    CHECK((simulation.motor_wrench().force_N - kPush.force_N).norm() < 1e-5);
    CHECK_FALSE(simulation.firmware().watchdog_tripped());
    simulation.advance_to(end + 63us, host);
    CHECK(simulation.motor_wrench().force_N == Vector3d::Zero());
    CHECK(simulation.motor_wrench().torque_Nm == Vector3d::Zero());
    CHECK(simulation.firmware().watchdog_tripped());
    CHECK_FALSE(simulation.firmware().motors_on());
  }
}

TEST_CASE("watchdog_tripped stays set until a command with enable") {
  Rig rig(still_hand());
  rig.trust();
  rig.write(kPush);
  DeviceSample sample = rig.read_after(5ms);
  CHECK(sample.motors_on);
  CHECK_FALSE(sample.watchdog_tripped);
  CHECK(sample.acknowledged == 1);
  sample = rig.read_after(15ms);
  CHECK_FALSE(sample.motors_on);
  CHECK(sample.watchdog_tripped);
  rig.write({}, false);
  CHECK(rig.read_after(3ms).watchdog_tripped);
  rig.write({}, true);
  sample = rig.read_after(3ms);
  CHECK(sample.motors_on);
  CHECK_FALSE(sample.watchdog_tripped);
}

TEST_CASE("switching the motors off is not a trip") {
  Rig rig(still_hand());
  rig.trust();
  rig.write(kPush);
  rig.read_after(2ms);
  rig.device.release(rig.clock.now());
  const DeviceSample sample = rig.read_after(15ms);
  CHECK(rig.simulation.motor_wrench().force_N == Vector3d::Zero());
  CHECK_FALSE(sample.motors_on);
  CHECK_FALSE(sample.watchdog_tripped);
  CHECK(sample.acknowledged == 6);
}

TEST_CASE("commands sent just before the link is closed still arrive") {
  Rig rig(still_hand());
  rig.trust();
  rig.write(kPush);
  rig.read_after(1ms);
  CHECK(rig.simulation.firmware().motors_on());
  rig.device.release(rig.clock.now());
  rig.device.close();
  rig.link.advance_to(rig.clock.now() + 1ms);
  CHECK_FALSE(rig.simulation.firmware().motors_on());
}

TEST_CASE("the firmware rejects repeated and incomplete commands") {
  SimulatedDevice simulation(reference_profile(), still_hand());
  Listener host;
  simulation.advance_to({}, host);
  CHECK(simulation.take_command(simulation.now(), command(65'535, kPush)));
  CHECK(simulation.take_command(simulation.now(), command(0, kPush)));             // the sequence wraps
  CHECK_FALSE(simulation.take_command(simulation.now(), command(0, kPush)));       // repeated
  CHECK_FALSE(simulation.take_command(simulation.now(), command(65'535, kPush)));  // backward
  auto bad = command(1, kPush);
  bad[5] ^= 1;
  CHECK_FALSE(simulation.take_command(simulation.now(), bad));
  bad = command(1, kPush);
  bad.pop_back();
  CHECK_FALSE(simulation.take_command(simulation.now(), bad));
  CHECK_FALSE(simulation.take_command(simulation.now(), {}));
}

TEST_CASE("repeated commands do not feed the watchdog, and a restarted host is accepted") {
  SimulatedDevice simulation(reference_profile(), still_hand());
  Listener host;
  simulation.advance_to({}, host);
  simulation.take_command(simulation.now(), command(500, kPush));
  for (int i = 0; i < 100; ++i) {
    simulation.advance_to(simulation.now() + 1ms, host);
    CHECK_FALSE(simulation.take_command(simulation.now(), command(500, kPush)));
  }
  CHECK(simulation.firmware().watchdog_tripped());
  CHECK(simulation.take_command(simulation.now(), command(1, kPush)));
  CHECK(simulation.firmware().motors_on());
}

TEST_CASE("a host that stops reading finds the oldest reports, as behind hidraw") {
  Rig rig(still_hand());
  const DeviceSample sample = rig.read_after(500ms);
  CHECK(sample.sequence == PacketQueue::kCapacity);
  CHECK(sample.superseded == PacketQueue::kCapacity - 1);
  CHECK(sample.fault == Fault::sample_stale);
  CHECK(rig.link.dropped() == 500 - PacketQueue::kCapacity);
  CHECK(rig.read_after(2ms).missing == 500 - PacketQueue::kCapacity);
}

TEST_CASE("a gap of more than a second is skipped, and the watchdog has tripped") {
  Rig rig(moving_hand());
  rig.write(kPush);
  rig.read_after(300ms);
  rig.write(kPush);
  rig.read_after(2ms);
  REQUIRE(rig.simulation.firmware().motors_on());
  rig.link.advance_to(rig.clock.now() + 1h);
  const DeviceSample back = rig.read_after(1h + 2ms);
  CHECK(back.fault == Fault::sample_stale);
  const DeviceSample sample = rig.read_after(1ms);
  CHECK(sample.fault == Fault::none);
  CHECK(sample.watchdog_tripped);
  CHECK_FALSE(sample.motors_on);
  CHECK(rig.simulation.motor_wrench().force_N == Vector3d::Zero());
  CHECK(sample.device_time_s == Approx(3600.3).epsilon(1e-5));
  CHECK(rig.clock.now() - rig.simulation.now() < 63us);
}

TEST_CASE("each injected fault appears as such for its duration") {
  struct Case {
    Kind kind;
    Fault fault;  ///< the fault raised while it is active
    std::uint32_t rejected;
  };
  for (const Case& c :
       {Case{Kind::silence, Fault::sample_stale, 0}, Case{Kind::freeze, Fault::sample_stale, 1},
        Case{Kind::corrupt, Fault::sample_stale, 1}, Case{Kind::short_report, Fault::sample_stale, 1},
        Case{Kind::bad_quaternion, Fault::pose_not_a_rotation, 0}}) {
    Rig rig(moving_hand());
    rig.simulation.inject({c.kind, 100ms, 50ms});
    CAPTURE(static_cast<int>(c.kind));
    for (int i = 1; i <= 100; ++i) REQUIRE(rig.read_after(1ms).fault == Fault::none);
    DeviceSample sample;
    for (int i = 1; i <= 30; ++i) sample = rig.read_after(1ms);
    CHECK(sample.fault == c.fault);
    CHECK(sample.rejected == c.rejected);
    for (int i = 1; i <= 30; ++i) sample = rig.read_after(1ms);
    CHECK(sample.fault == Fault::none);
    CHECK(sample.fresh);
  }
}

TEST_CASE("an injected jump appears at its start and its end") {
  Rig rig(still_hand());
  rig.simulation.inject({Kind::jump, 50ms, 20ms});
  int teleports = 0;
  for (int i = 0; i < 200; ++i) teleports += rig.read_after(1ms).fault == Fault::pose_jumped ? 1 : 0;
  CHECK(teleports == 2);
}

TEST_CASE("a device that rejects commands trips its watchdog") {
  Rig rig(still_hand());
  rig.simulation.inject({Kind::reject_commands, 50ms, 50ms});
  DeviceSample sample;
  for (int i = 1; i < 50; ++i) {
    sample = rig.read_after(1ms);
    REQUIRE(rig.write(kPush) == Fault::none);
  }
  CHECK(sample.motors_on);
  for (int i = 0; i < 50; ++i) {
    sample = rig.read_after(1ms);
    REQUIRE(rig.write(kPush) == Fault::write_failed);
  }
  CHECK(sample.watchdog_tripped);
  CHECK(rig.simulation.motor_wrench().force_N == Vector3d::Zero());
}

TEST_CASE("an unplugged device is lost at once, releases the hand, and must be opened again") {
  for (const Duration unplugged : {Duration{100us}, Duration{50ms}}) {
    Rig rig(still_hand());
    rig.simulation.inject({Kind::unplug, 20ms + 300us, unplugged});
    for (int i = 0; i < 20; ++i) {
      REQUIRE(rig.read_after(1ms).fault == Fault::none);
      rig.write(kPush);
    }
    CHECK(rig.read_after(1ms).fault == Fault::device_lost);
    CHECK(rig.write(kPush) == Fault::device_lost);
    rig.device.release(rig.clock.now());
    if (unplugged > 1ms) CHECK_THROWS_WITH(rig.device.open(), Catch::Contains("unplugged"));
    CHECK(rig.read_after(10ms).fault == Fault::device_lost);
    rig.link.advance_to(rig.clock.now());  // the device continues although the link is closed
    CHECK(rig.simulation.motor_wrench().force_N == Vector3d::Zero());
    CHECK(rig.read_after(50ms).fault == Fault::device_lost);
    rig.device.open();
    CHECK(rig.read_after(0ms).fault == Fault::none);
    CHECK(rig.read_after(3ms).fault == Fault::none);
    CHECK(rig.read_after(1ms).fresh);
  }
}

TEST_CASE("two simulated minutes with commands every millisecond stay whole and bounded") {
  Rig rig(moving_hand());
  std::uint64_t lost = 0;
  for (int i = 0; i < 120'000; ++i) {
    const DeviceSample sample = rig.read_after(1ms);
    lost += sample.missing + sample.superseded + sample.rejected;
    const Vector3d pull = -0.5 * sample.V_BH.linear_m_per_s;
    if (sample.fault != Fault::none || rig.write({pull, Vector3d::Zero()}) != Fault::none)
      FAIL("fault at tick " << i);
  }
  CHECK(lost == 0);
  CHECK(rig.link.dropped() == 0);
  CHECK(std::abs(rig.simulation.X_BH().rotation.norm() - 1.0) < 1e-12);
  CHECK(rig.simulation.X_BH().translation_m.norm() < 0.1);
  CHECK(rig.simulation.handle().energy().motors_J < 0.0);
}

TEST_CASE("a profile that the simulated device does not support is rejected") {
  DeviceProfile profile = reference_profile();
  profile.wrench_report.torque.present = false;
  CHECK_THROWS_WITH(SimulatedDevice(profile, SimulationSettings{}),
                    Catch::Contains("choose a profile that inherits"));
  profile = reference_profile();
  profile.kinematics.kind = Kinematics::Kind::delta;
  CHECK_THROWS_WITH(SimulatedDevice(profile, SimulationSettings{}),
                    Catch::Contains("device profile loopback"));
}

}  // namespace wrenchd::test_simulated_device
