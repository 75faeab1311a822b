// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/kinematics.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/profile_device.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_simulated_link {

using namespace std::chrono_literals;
using Catch::Contains;
using Kind = SimulatedFault::Kind;

namespace {

const SearchPath kShipped({test::source_path("config")});

/// All shipped profiles, read from the folder.
std::vector<DeviceProfile> all_shipped() {
  std::vector<DeviceProfile> profiles;
  for (const auto& file : profile_files(kShipped)) profiles.push_back(load_profile(file, kShipped));
  return profiles;
}

DeviceProfile shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml", kShipped);
}

/// No delays and no quanta except those of the protocol: the resolution of the device remains.
SimulationSettings exact(std::vector<Waypoint> hand_path) {
  SimulationSettings s;
  s.hand_path = std::move(hand_path);
  s.hand_repeats = false;
  s.position_quantum_m = s.rotation_quantum_rad = 0.0;
  s.report_delay_s = s.command_delay_s = 0.0;
  return s;
}

SimulationSettings moving() {
  return exact({{0.0, {0.02, 0.0, 0.04}, {0, 0, 0}},
                {2.0, {0.02, 0.0, 0.04}, {0, 0, 0}},
                {3.0, {-0.01, 0.03, 0.02}, {0.2, 0.3, 0.0}},
                {4.0, {0.0, -0.03, 0.0}, {0.0, 0.1, -0.4}},
                {5.0, {0.02, 0.01, 0.03}, {0.1, 0.0, 0.0}}});
}
SimulationSettings still() {
  return exact({{0.0, {0.01, -0.02, 0.03}, {0, 0, 0}}});
}

/// A device of a profile over its simulated link, in virtual time.
struct Session {
  Session(const DeviceProfile& profile, const SimulationSettings& settings)
      : link(make_simulated_link(profile, settings, clock)), device(profile, *link) {
    period = std::min<Duration>(from_seconds(1.0 / profile.report_rate_Hz), 1ms);
  }
  const DeviceProfile& profile() const { return device.profile(); }
  void open() {
    device.open();
    sample = device.read_newest(clock.now());
  }
  void step(const Wrench& F = {}, bool motors_on = false) {
    clock.sleep_until(clock.now() + period);
    sample = device.read_newest(clock.now());
    written = device.write(clock.now(), F, motors_on);
  }
  void run(
      Duration time, const std::function<void()>& each = [] {}) {
    for (const TimePoint end = clock.now() + time; clock.now() < end; each()) step();
  }
  /// Runs until the device sends poses and the hand rests.
  void run_until_still() {
    open();
    run(2s);
    REQUIRE(sample.homed);
    REQUIRE(sample.fault == Fault::none);
  }

  VirtualClock clock;
  std::unique_ptr<SimulatedLink> link;
  ProfileDevice device;
  Duration period{};
  DeviceSample sample;
  Fault written = Fault::none;
};

/// Change of the pose by half a count of each encoder.
struct Resolution {
  double m = 1e-6;
  double rad = 1e-6;
};

/// Change of the pose by rounding to the steps of the report fields.
Resolution resolution_of_fields(const DeviceProfile& profile) {
  const PoseReportLayout& report = profile.pose_report;
  Resolution resolution;
  if (report.position.present) resolution.m = std::max(1e-6, 0.87 * report.position.step);
  if (report.orientation.present) resolution.rad = std::max(1e-6, 2.0 * report.orientation.step);
  return resolution;
}

Resolution resolution_at(const DeviceProfile& profile, const Pose& X_BH) {
  const Kinematics& k = profile.kinematics;
  if (k.kind == Kinematics::Kind::none) return resolution_of_fields(profile);
  const Pose X_DE = inverse(profile.X_BD) * X_BH * inverse(profile.X_EH);
  const auto angles = wrenchd::inverse(k, X_DE);
  REQUIRE(angles);
  Resolution sum;
  for (std::size_t i = 0; i < k.joints; ++i) {
    const double half_count_rad = 0.5 * std::abs(k.rad_per_count[i]);
    JointAngles off = *angles;
    off[i] += half_count_rad;
    const auto moved = forward_kinematics(k, off, X_DE);
    REQUIRE(moved);
    sum.m += 1.02 * (moved->translation_m - X_DE.translation_m).norm();
    if (k.joints == kMaxJoints) sum.rad += half_count_rad;
  }
  return sum;
}

/// Pose of the nearest counts.
Pose on_counts(const DeviceProfile& profile, const Pose& X_BH) {
  const Kinematics& k = profile.kinematics;
  if (k.kind == Kinematics::Kind::none) return X_BH;
  const Pose X_DE = inverse(profile.X_BD) * X_BH * inverse(profile.X_EH);
  JointCounts counts = joint_counts(k, *wrenchd::inverse(k, X_DE));
  for (double& count : counts) count = std::round(count);
  return profile.X_BD * *forward_kinematics(k, joint_angles(k, counts), X_DE) * profile.X_EH;
}

double apart_m(const Pose& a, const Pose& b) {
  return (a.translation_m - b.translation_m).norm();
}
double apart_rad(const Pose& a, const Pose& b) {
  return a.rotation.angularDistance(b.rotation);
}

bool senses_turns(const DeviceProfile& profile) {
  return (sensed_dofs(profile) & kAngularDofs) != 0;
}
bool is_puck(const DeviceProfile& profile) {
  return pose_source(profile) == PoseSource::deflection;
}

}  // namespace

TEST_CASE("the pose follows the motion of the hand, for every shipped profile", "[simulation]") {
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name);
    Session s(profile, moving());
    s.open();
    int compared = 0;
    double least_x = 1.0, most_x = -1.0;
    s.run(6s, [&] {
      REQUIRE(s.sample.fault == Fault::none);
      if (!s.sample.fresh) return;
      const Pose& truth = s.link->device().X_BH();
      const Pose& reported = s.sample.X_BH;
      const Resolution resolution = resolution_at(profile, truth);
      const Pose expected = on_counts(profile, truth);
      INFO((reported.translation_m - truth.translation_m).transpose()
           << " m, at " << seconds(s.clock.now().time_since_epoch()));
      REQUIRE(apart_m(reported, expected) <= resolution_of_fields(profile).m);
      REQUIRE(apart_rad(reported, expected) <= resolution_of_fields(profile).rad);
      REQUIRE(apart_m(reported, truth) <= resolution.m);
      REQUIRE(apart_rad(reported, truth) <= resolution.rad);
      ++compared;
      least_x = std::min(least_x, reported.translation_m.x());
      most_x = std::max(most_x, reported.translation_m.x());
    });
    // A Falcon sends no valid pose before it is homed.
    CHECK(compared >= 5.3 / seconds(s.period));
    CHECK(most_x - least_x > 0.025);
    // The hand has reached its goal: a free handle and a steered tool follow it.
    const HandTarget target = s.link->device().hand_target();
    CHECK(apart_m(s.sample.X_BH, target.X_BG) < 3e-4);
    if (senses_turns(profile)) CHECK(apart_rad(s.sample.X_BH, target.X_BG) < 0.012);
    CHECK(s.link->dropped() == 0);
  }
}

TEST_CASE("a wrench arrives as force on the simulated handle, for every shipped profile", "[simulation]") {
  const Wrench F{{1.0, -0.5, 0.8}, {0.01, 0.02, -0.03}};
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name);
    const SimulationSettings settings = still();
    Session s(profile, settings);
    s.run_until_still();
    const Pose before = s.link->device().X_BH();
    for (int i = 0; i < std::lround(1.0 / seconds(s.period)); ++i) {
      s.step(F, true);
      REQUIRE(s.written == Fault::none);
    }
    const DofMask driven = driven_dofs(profile);
    const Wrench motor_wrench = s.link->device().motor_wrench();
    const Vector3d moved = s.link->device().X_BH().translation_m - before.translation_m;
    if (driven == kNoDof) {
      CHECK(motor_wrench.force_N.isZero());
      CHECK(s.sample.dropped_dofs == kAllDofs);
      continue;
    }
    // Efforts are counts too: 1 mA, or one of 4096.
    const double resolution_N = driven == kAllDofs ? 1e-3 : 0.02;
    CHECK((motor_wrench.force_N - F.force_N).norm() < resolution_N);
    CHECK((moved - F.force_N / settings.hand_stiffness_N_per_m).norm() <
          resolution_N / settings.hand_stiffness_N_per_m + 1e-6);
    if (driven == kAllDofs) CHECK((motor_wrench.torque_Nm - F.torque_Nm).norm() < 1e-5);
  }
}

TEST_CASE("a rendered wall stops the hand, for every shipped profile with motors", "[simulation]") {
  constexpr double kWall_N_per_m = 200.0, kWallAt_m = 0.02, kDeep_m = 0.006;
  for (const DeviceProfile& profile : all_shipped()) {
    if (driven_dofs(profile) == kNoDof) continue;
    INFO(profile.name);
    SimulationSettings settings = exact({{0.0, {0.0, 0.0, 0.04}, {0, 0, 0}},
                                         {2.0, {0.0, 0.0, 0.04}, {0, 0, 0}},
                                         {3.0, {0.0, 0.0, kWallAt_m - kDeep_m}, {0, 0, 0}}});
    settings.report_delay_s = settings.command_delay_s = 0.0002;
    Session s(profile, settings);
    s.run_until_still();
    Wrench F;
    for (int i = 0; i < std::lround(3.0 / seconds(s.period)); ++i) {
      s.step(F, true);
      REQUIRE(s.sample.fault == Fault::none);
      const double depth_m = std::max(kWallAt_m - s.sample.X_BH.translation_m.z(), 0.0);
      F.force_N = {0.0, 0.0, kWall_N_per_m * depth_m};
    }
    // Two springs: K_wall d = K_hand (deep - d).
    const double K = settings.hand_stiffness_N_per_m;
    const double depth_m = kWallAt_m - s.link->device().X_BH().translation_m.z();
    CHECK(depth_m == Approx(K * kDeep_m / (K + kWall_N_per_m)).margin(1e-4));
  }
}

TEST_CASE("if the host hangs, the device's watchdog releases the hand", "[simulation]") {
  for (const DeviceProfile& profile : all_shipped()) {
    if (driven_dofs(profile) == kNoDof) continue;
    INFO(profile.name);
    Session s(profile, still());
    s.run_until_still();
    for (int i = 0; i < 100; ++i) s.step({{0.0, 0.0, 1.0}, {0, 0, 0}}, true);
    const auto pushed = [&] { return s.link->device().motor_wrench().force_N.z(); };
    REQUIRE(pushed() > 0.9);
    std::array<std::uint8_t, kMaxReportBytes> buffer;
    const auto hang = [&](double time_s) {
      s.clock.sleep_until(s.clock.now() + from_seconds(time_s));
      s.link->read(s.clock.now(), buffer);
    };
    if (!(profile.watchdog_s > 0.0)) {
      hang(0.9);
      CHECK(pushed() > 0.9);
      continue;
    }
    hang(profile.watchdog_s - 0.002);
    CHECK(pushed() > 0.9);
    hang(0.005);
    CHECK(pushed() == 0.0);
  }
}

TEST_CASE("transport faults appear on every shipped profile as on the simulated device", "[simulation]") {
  const Kind kind = GENERATE(Kind::unplug, Kind::silence, Kind::freeze, Kind::corrupt, Kind::short_report,
                             Kind::reject_commands);
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name << ", fault " << static_cast<int>(kind));
    SimulationSettings settings = moving();
    Session s(profile, settings);
    s.link->device().inject({kind, 2500500us, 500ms});
    s.open();
    s.run(2500ms);
    REQUIRE(s.sample.fault == Fault::none);
    std::uint32_t rejected = 0;
    int fresh = 0;
    Fault fault = Fault::none, written = Fault::none;
    s.run(500ms, [&] {
      rejected += s.sample.rejected;
      fresh += s.sample.fresh && !is_puck(profile) ? 1 : 0;  // the pose of a puck continues between reports
      if (fault == Fault::none) fault = s.sample.fault;
      if (written == Fault::none) written = s.written;
    });
    const PoseReportLayout& report = profile.pose_report;
    const std::size_t least = report.min_length == 0 ? report.length : report.min_length;
    switch (kind) {
      case Kind::unplug:
        CHECK(fault == Fault::device_lost);
        CHECK(written == Fault::device_lost);
        break;
      case Kind::silence:
        CHECK(fault == Fault::sample_stale);
        CHECK(fresh * seconds(s.period) <= 0.001);  // before the fault begins
        break;
      case Kind::freeze:  // not detectable without a sequence
        CHECK((rejected > 400) == report.sequence.present);
        break;
      case Kind::corrupt:  // not detectable without a checksum
        CHECK((rejected > 400) == (report.checksum != Checksum::none));
        break;
      case Kind::short_report:
        CHECK((rejected > 25) == (report.length / 2 < least));
        break;
      case Kind::reject_commands:
        CHECK((written == Fault::write_failed) == profile.has_output);
        break;
      default:
        FAIL();
    }
    s.run(3s);  // the fault is over
    if (kind != Kind::unplug) {
      CHECK(s.sample.fault == Fault::none);
      continue;
    }
    CHECK(s.sample.fault == Fault::device_lost);
    s.device.close();
    s.open();
    s.run(2s);
    CHECK(s.sample.fault == Fault::none);
    CHECK(s.sample.homed);
    CHECK(s.sample.fresh);
  }
}

TEST_CASE("an injected pose fault appears on devices that send a pose", "[simulation]") {
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name);
    Session s(profile, still());
    DeviceInHand& device = s.link->device();
    const bool tells_pose = pose_source(profile) == PoseSource::pose;
    if (!tells_pose)
      CHECK_THROWS_WITH(device.inject({Kind::bad_quaternion, 0s, 1s}), Contains("choose another fault"));
    if (is_puck(profile)) {
      CHECK_THROWS_WITH(device.inject({Kind::jump, 0s, 1s}), Contains("choose another fault"));
      continue;
    }
    device.inject({Kind::jump, 2500ms, 100ms});
    if (tells_pose) device.inject({Kind::bad_quaternion, 2800ms, 100ms});
    s.run_until_still();
    int teleported = 0, bad = 0;
    s.run(1s, [&] {
      teleported += s.sample.fault == Fault::pose_jumped ? 1 : 0;
      bad += s.sample.fault == Fault::pose_not_a_rotation ? 1 : 0;
    });
    CHECK(teleported == 2);
    CHECK((bad > 0) == tells_pose);
  }
}

TEST_CASE("an open simulated link does not allocate or lock", "[simulation]") {
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name);
    Session s(profile, moving());
    s.run_until_still();
    std::uint64_t allocations = 0, locks = 0;
    {
      const test::RealtimeGuard guard;
      for (int i = 0; i < 4000; ++i) {
        s.step({{0.1, 0, 0}, {0, 0, 0}}, true);
        s.device.wait_readable(s.clock.now() + 100us);
      }
      allocations = guard.allocations();
      locks = guard.locks();
    }
    CHECK(allocations == 0);
    CHECK(locks == 0);
  }
}

TEST_CASE("a simulated run does not depend on how calls divide the time", "[simulation]") {
  for (const DeviceProfile& profile : all_shipped()) {
    INFO(profile.name);
    const auto run = [&](Duration cut) {
      Session s(profile, moving());
      s.run_until_still();
      std::array<std::uint8_t, kMaxReportBytes> buffer;
      for (Duration t{}; t < 1s; t += 10ms) {
        for (const TimePoint end = s.clock.now() + 10ms; s.clock.now() < end;) {
          s.clock.sleep_until(std::min(end, s.clock.now() + cut));
          s.link->read(s.clock.now(), buffer);
        }
      }
      return s.link->device().X_BH();
    };
    CHECK(same_bits(run(10ms), run(137us)));
  }
}

TEST_CASE("a device with its own frames is simulated in these frames", "[simulation]") {
  DeviceProfile profile = shipped("reference_full_speed");
  profile.X_BD = {rotation_from({0.3, -0.5, 1.1}), {0.02, -0.01, 0.05}};
  profile.X_EH = {rotation_from({-0.2, 0.4, 0.1}), {0.03, 0.04, -0.02}};
  Session s(profile, moving());
  s.open();
  s.run(5s, [&] {
    REQUIRE(s.sample.fault == Fault::none);
    REQUIRE(apart_m(s.sample.X_BH, s.link->device().X_BH()) < 1e-6);
    REQUIRE(apart_rad(s.sample.X_BH, s.link->device().X_BH()) < 1e-6);
  });
  const Wrench F{{1.0, -0.5, 0.8}, {0.01, 0.02, -0.03}};
  for (int i = 0; i < 1000; ++i) s.step(F, true);
  const Wrench motor_wrench = s.link->device().motor_wrench();
  CHECK((motor_wrench.force_N - F.force_N).norm() < 1e-5);
  CHECK((motor_wrench.torque_Nm - F.torque_Nm).norm() < 1e-5);
}

TEST_CASE("a puck at rest sends nothing, and the tool keeps its pose", "[simulation]") {
  for (const char* name : {"spacemouse_split", "spacemouse_combined"}) {
    INFO(name);
    Session s(shipped(name), still());
    s.open();
    s.run(5s);
    const std::uint64_t sequence = s.sample.sequence;
    const Pose left = s.sample.X_BH;
    CHECK(apart_m(left, s.link->device().hand_target().X_BG) < 3e-4);
    s.run(5s);
    CHECK(s.sample.sequence == sequence);
    CHECK(same_bits(s.sample.X_BH, left));
  }
}

TEST_CASE("in position mode the hand holds the puck at the goal of the tool", "[simulation]") {
  DeviceProfile profile = shipped("spacemouse_combined");
  profile.deflection->mode = Deflection::Mode::position;
  profile.deflection->linear_gain = 71.0;
  profile.deflection->angular_gain = 11.4;
  Session s(profile, still());
  s.open();
  s.run(3s);
  const Pose target = s.link->device().hand_target().X_BG;
  CHECK(apart_m(s.sample.X_BH, target) < 71.0 * 4e-6);  // one count of the translation
  CHECK(apart_rad(s.sample.X_BH, target) < 11.4 * 2.5e-4);
}

TEST_CASE("an arm has an end stop at the boundary of its workspace and returns from it", "[simulation]") {
  for (const char* name : {"polhem", "woodenhaptics", "falcon"}) {
    INFO(name);
    Session s(shipped(name), exact({{0.0, {0.0, 0.0, 0.03}, {0, 0, 0}},
                                    {2.0, {0.0, 0.0, 0.03}, {0, 0, 0}},
                                    {3.0, {0.0, 0.0, 1.0}, {0, 0, 0}},
                                    {4.0, {0.0, 0.0, 1.0}, {0, 0, 0}},
                                    {5.0, {0.0, 0.0, 0.03}, {0, 0, 0}}}));
    s.run_until_still();
    double highest_m = 0.0;
    s.run(2s, [&] { highest_m = std::max(highest_m, s.link->device().X_BH().translation_m.z()); });
    CHECK(highest_m > 0.04);
    CHECK(highest_m < 0.5);
    s.run(2s);
    CHECK(apart_m(s.link->device().X_BH(), s.link->device().hand_target().X_BG) < 1e-3);
  }
}

TEST_CASE("an arm with an unreachable first waypoint starts at the nearest reachable pose", "[simulation]") {
  VirtualClock clock;
  const auto link = make_simulated_link(shipped("polhem"), exact({{0.0, {0, 0, 5.0}, {0, 0, 0}}}), clock);
  CHECK(link->device().X_BH().translation_m.z() > 0.132);
  CHECK(link->device().X_BH().translation_m.z() < 0.4);
}

TEST_CASE("a profile without an emulator is rejected with the remedy", "[simulation]") {
  VirtualClock clock;
  DeviceProfile arm = shipped("polhem");
  arm.name = "my_arm";
  SECTION("encoders elsewhere") {
    arm.pose_report.joints.byte = 2;
  }
  SECTION("another byte order") {
    arm.pose_report.joints.big_endian = true;
  }
  SECTION("currents in other steps") {
    arm.wrench_report.efforts.step = 0.002;
  }
  SECTION("longer commands") {
    arm.wrench_report.length = 20;
  }
  CHECK_THROWS_WITH(make_simulated_link(arm, still(), clock),
                    Contains("my_arm") && Contains("Polhem") && Contains("inherits polhem"));
  DeviceProfile puck = shipped("spacemouse_split");
  puck.pose_report.translation.big_endian = true;
  CHECK_THROWS_WITH(make_simulated_link(puck, still(), clock),
                    Contains("spacemouse_split") && Contains("differ from those of a SpaceMouse"));
  puck = shipped("spacemouse_split");
  puck.more_reports.clear();
  CHECK_THROWS_WITH(make_simulated_link(puck, still(), clock), Contains("do not carry both"));
  CHECK_THROWS_WITH(make_simulated_link(shipped("falcon"), exact({}), clock),
                    Contains("at least one waypoint"));
}

}  // namespace wrenchd::test_simulated_link
