// SPDX-License-Identifier: GPL-3.0-or-later
#include <functional>
#include <limits>

#include <catch2/catch.hpp>

#include "config/calibration_store.hpp"
#include "devices/homing.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_homing {

namespace {

bool is_done(const Homing& homing) {
  return homing.state().step == HomingStep::done;
}

using namespace test;

/// A device in an operator's hand, 1000 samples per second, with optional errors.
struct Bench {
  explicit Bench(const HomingPlan& plan = {}) : homing(plan) {}
  Bench(const HomingPlan& plan, const PoseOffset& stored) : homing(plan, stored) {}

  Homing homing;
  Pose X_BH;  ///< true pose of the handle
  std::function<void(DeviceSample&)> spoil = [](DeviceSample&) {};
  TimePoint now{};
  double time_s = 0.0;
  std::vector<std::string> instructions;  ///< instructions received, without consecutive repetitions

  const HomingState& state() const { return homing.state(); }

  DeviceSample sample(const Twist& V) const {
    DeviceSample sample;
    sample.X_BH = X_BH;
    sample.V_BH = V;
    sample.device_time_s = time_s;
    sample.fresh = true;
    return sample;
  }
  void tick(const Twist& V = {}) {
    now += std::chrono::milliseconds(1);
    time_s += 0.001;
    DeviceSample next = sample(V);
    spoil(next);
    homing.advance(next, now);
    const std::string words = operator_instruction(state());
    if (instructions.empty() || instructions.back() != words) instructions.push_back(words);
  }
  void hold(double for_s) {
    for (int i = 0; i < static_cast<int>(1000 * for_s); ++i) tick();
  }
  /// Moves along or about an axis within 0.2 s, or until the instruction changes.
  void move(std::size_t axis, double way) {
    const auto k = static_cast<Eigen::Index>(axis % 3);
    Twist V;
    (axis < 3 ? V.linear_m_per_s : V.angular_rad_per_s)[k] = way / 0.2;
    for (int i = 0; i < 200 && state().step == HomingStep::moving; ++i) {
      X_BH.translation_m += 0.001 * V.linear_m_per_s;
      X_BH.rotation = (rotation_from(0.001 * V.angular_rad_per_s) * X_BH.rotation).normalized();
      tick(V);
    }
  }
  /// Follows the instruction, slightly farther than needed.
  void follow_instruction() {
    if (state().step == HomingStep::moving) return move(state().axis, state().axis < 3 ? 0.03 : 0.35);
    hold(0.05);
    if (state().step == HomingStep::reference && state().progress == 1.0) homing.confirm();
  }
  /// Follows instructions until homing ends, at most one simulated minute.
  void follow_all_instructions() {
    while (time_s < 60.0 && state().step != HomingStep::done && state().step != HomingStep::failed)
      follow_instruction();
  }
};

HomingPlan with_reference(ReferenceSchedule use) {
  HomingPlan plan;
  plan.reference = use;
  plan.X_BR = {Quaterniond(Eigen::AngleAxisd(0.3, Vector3d::UnitY())), {0.1, 0.0, -0.05}};
  return plan;
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST_CASE("a correct device is homed when the operator follows the instructions", "[homing]") {
  Bench bench;
  CHECK(operator_instruction(bench.state()) == "Waiting for the device to report.");
  bench.follow_all_instructions();
  CHECK(is_done(bench.homing));
  const std::vector<std::string> expected = {
      "Hold the handle still.", "Push the handle straight away from you.",
      "Hold the handle still.", "Move the handle straight to the left.",
      "Hold the handle still.", "Lift the handle straight up.",
      "Hold the handle still.", "Tip the top of the handle to the right.",
      "Hold the handle still.", "Tip the top of the handle away from you.",
      "Hold the handle still.", "Turn the handle to the left, counterclockwise as seen from above.",
      "Hold the handle still.", "Homed: the device may be armed.",
  };
  CHECK(bench.instructions == expected);
}

TEST_CASE("the instructions describe the positive directions of the axes", "[homing]") {
  const auto top_goes = [](const Vector3d& axis) {
    return Vector3d(Eigen::AngleAxisd(0.1, axis) *
                    Vector3d::UnitZ());  // top of the handle, x forward, y left
  };
  CHECK(top_goes(Vector3d::UnitX()).y() < 0);                                      // to the right
  CHECK(top_goes(Vector3d::UnitY()).x() > 0);                                      // away from the user
  CHECK((Eigen::AngleAxisd(0.1, Vector3d::UnitZ()) * Vector3d::UnitX()).y() > 0);  // its front to the left
}

TEST_CASE("homing is not done before every axis has moved", "[homing]") {
  for (std::size_t stuck = 0; stuck < 6; ++stuck) {
    Bench bench;
    bench.spoil = [stuck](DeviceSample& sample) {
      Vector3d turn = rotation_vector(sample.X_BH.rotation);
      (stuck < 3 ? sample.X_BH.translation_m : turn)[static_cast<Eigen::Index>(stuck % 3)] = 0.0;
      sample.X_BH.rotation = rotation_from(turn);
    };
    // Long enough for the request of the stuck axis, and some more.
    for (int i = 0; i < 200; ++i) bench.follow_instruction();
    INFO("axis " << stuck);
    CHECK_FALSE(is_done(bench.homing));
  }
  Bench idle;
  idle.hold(100.0);
  CHECK(idle.state().step == HomingStep::moving);
  CHECK(idle.state().axis == 0);
}

TEST_CASE("after an operator error homing asks once more", "[homing]") {
  Bench bench;
  bench.hold(0.5);
  REQUIRE(bench.state().step == HomingStep::moving);
  bench.move(0, -0.03);
  CHECK(operator_instruction(bench.state()) ==
        "That moved x in the opposite direction. Hold the handle still.");
  bench.hold(0.5);
  CHECK(operator_instruction(bench.state()) ==
        "That moved x in the opposite direction. Push the handle straight away from you.");
  bench.move(0, 0.03);
  bench.hold(0.5);
  REQUIRE(bench.state().axis == 1);
  bench.move(2, 0.03);
  CHECK(operator_instruction(bench.state()) == "That moved z, not y. Hold the handle still.");
  bench.follow_all_instructions();
  CHECK(is_done(bench.homing));
}

TEST_CASE("the return to the centre does not count as the next axis", "[homing]") {
  Bench bench;
  bench.hold(0.5);
  bench.move(0, 0.03);
  REQUIRE(bench.state().step == HomingStep::holding_still);
  for (int i = 0; i < 300; ++i) {  // while the operator moves the handle back
    bench.X_BH.translation_m.x() -= 0.0001;
    bench.tick();
  }
  CHECK(bench.state().step == HomingStep::holding_still);
  CHECK(bench.state().problem == HomingProblem::none);
  bench.follow_all_instructions();
  CHECK(is_done(bench.homing));
}

TEST_CASE("homing detects a wrong sign in the profile", "[homing]") {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Bench bench;
    bench.spoil = [axis](DeviceSample& s) {
      s.X_BH.translation_m[axis] *= -1.0;
      s.V_BH.linear_m_per_s[axis] *= -1.0;
    };
    bench.follow_all_instructions();
    CHECK(bench.state().step == HomingStep::failed);
    CHECK(bench.state().problem == HomingProblem::wrong_direction);
    CHECK(bench.state().axis == static_cast<std::size_t>(axis));
    CHECK(holds(operator_instruction(bench.state()), "The sign is wrong: check it in the profile"));
  }
  Bench mirrored;  // a quaternion with inverted y
  mirrored.spoil = [](DeviceSample& s) { s.X_BH.rotation.y() *= -1.0; };
  mirrored.follow_all_instructions();
  CHECK(mirrored.state().problem == HomingProblem::wrong_direction);
  CHECK(mirrored.state().axis == 4);
}

TEST_CASE("homing detects exchanged axes", "[homing]") {
  Bench bench;
  bench.spoil = [](DeviceSample& s) { std::swap(s.X_BH.translation_m.y(), s.X_BH.translation_m.z()); };
  bench.follow_all_instructions();
  CHECK(bench.state().step == HomingStep::failed);
  CHECK(bench.state().problem == HomingProblem::wrong_axis);
  CHECK(operator_instruction(bench.state()) ==
        "Homing failed. That moved z, not y. Axes are exchanged: check their order in the profile, and the "
        "plugs of the encoders.");
  CHECK_FALSE(is_done(bench.homing));

  Bench turns;  // y and z of the quaternion exchanged
  turns.spoil = [](DeviceSample& s) { std::swap(s.X_BH.rotation.y(), s.X_BH.rotation.z()); };
  turns.follow_all_instructions();
  CHECK(turns.state().problem == HomingProblem::wrong_axis);
  CHECK(turns.state().moved_axis == 5);
}

TEST_CASE("homing detects a velocity with the wrong sign and accepts a device without velocities",
          "[homing]") {
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    Bench bench;
    bench.spoil = [axis](DeviceSample& s) {
      (axis < 3 ? s.V_BH.linear_m_per_s : s.V_BH.angular_rad_per_s)[axis % 3] *= -1.0;
    };
    bench.follow_all_instructions();
    CHECK(bench.state().step == HomingStep::failed);
    CHECK(bench.state().problem == HomingProblem::velocity_sign_mismatch);
    CHECK(bench.state().axis == static_cast<std::size_t>(axis));
  }
  Bench silent;
  silent.spoil = [](DeviceSample& s) { s.V_BH = {}; };
  silent.follow_all_instructions();
  CHECK(is_done(silent.homing));
}

TEST_CASE("the reference pose gives the offset of the device", "[homing]") {
  const HomingPlan plan = with_reference(ReferenceSchedule::each_start);
  RandomValues random(11);
  for (int i = 0; i < 20; ++i) {
    Bench bench(plan);
    const PoseOffset off{random.vector<3>(0.02), random.vector<3>(0.1)};
    bench.X_BH = plan.X_BR;
    bench.spoil = [&](DeviceSample& s) {  // arbitrary zero, and noise in the last digit
      s.X_BH = {s.X_BH.rotation * rotation_from(off.rotation_rad), s.X_BH.translation_m + off.position_m};
      s.X_BH.translation_m += random.vector<3>(2e-5);
    };
    bench.follow_all_instructions();
    REQUIRE(is_done(bench.homing));
    CHECK((bench.homing.offset().position_m - off.position_m).norm() < 1e-5);
    CHECK((bench.homing.offset().rotation_rad - off.rotation_rad).norm() < 1e-9);
    DeviceSample raw = bench.sample({});
    bench.spoil(raw);
    const Pose X_BH = corrected(raw.X_BH, bench.homing.offset());
    CHECK((X_BH.translation_m - bench.X_BH.translation_m).norm() < 2e-4);
    CHECK(X_BH.rotation.angularDistance(bench.X_BH.rotation) < 1e-9);
  }
}

TEST_CASE("the reference pose must be confirmed, still and within the maximum offset", "[homing]") {
  HomingPlan plan = with_reference(ReferenceSchedule::each_start);
  plan.confirm_buttons = 0x4;
  Bench bench(plan);
  bench.X_BH = plan.X_BR;
  bench.X_BH.translation_m.x() += 0.2;
  bench.hold(5.0);
  CHECK(bench.state().step == HomingStep::reference);  // stillness alone is not enough
  CHECK(operator_instruction(bench.state()) ==
        "Put the handle into its reference pose, release it, and confirm.");

  std::uint32_t buttons = 0x3;
  bench.spoil = [&](DeviceSample& s) { s.buttons = buttons; };
  bench.hold(0.1);
  CHECK(bench.state().problem == HomingProblem::none);  // other buttons have no effect
  buttons = 0x4;
  bench.hold(0.1);
  buttons = 0;
  CHECK(bench.state().step == HomingStep::reference);
  CHECK(bench.state().problem == HomingProblem::not_at_reference);
  CHECK(holds(operator_instruction(bench.state()), "too far from the reference pose"));

  for (int i = 0; i < 1000; ++i) {
    bench.X_BH.translation_m.x() -= 0.0002;
    bench.tick();
  }
  bench.homing.confirm();
  bench.X_BH.translation_m.x() -= 0.002;
  bench.tick();
  CHECK(bench.state().problem == HomingProblem::not_still);
  bench.hold(0.9);
  CHECK(bench.state().step == HomingStep::reference);
  bench.hold(0.2);  // now it has been still for a second
  CHECK(bench.state().step == HomingStep::holding_still);
  CHECK(bench.homing.offset().position_m.x() == Approx(-0.002));
}

TEST_CASE("a stored offset replaces the reference pose only for absolute encoders", "[homing]") {
  const PoseOffset stored{{0.01, 0, 0}, {0, 0, 0.1}};
  Bench once(with_reference(ReferenceSchedule::once), stored);
  once.tick();
  CHECK(once.state().step == HomingStep::holding_still);
  CHECK(once.homing.offset().position_m == stored.position_m);

  Bench first(with_reference(ReferenceSchedule::once));
  first.tick();
  CHECK(first.state().step == HomingStep::reference);

  Bench each(with_reference(ReferenceSchedule::each_start), stored);
  each.tick();
  CHECK(each.state().step == HomingStep::reference);
  CHECK(each.homing.offset().position_m.norm() == 0.0);

  Bench foreign(with_reference(ReferenceSchedule::once), PoseOffset{{0.5, 0, 0}, Vector3d::Zero()});
  foreign.tick();
  CHECK(foreign.state().step == HomingStep::failed);
  CHECK(foreign.state().problem == HomingProblem::stored_offset_too_large);
}

TEST_CASE("an offset survives conversion to the calibration store and back", "[homing]") {
  const TemporaryDirectory dir;
  const CalibrationStore store(dir.path());
  const PoseOffset offset{{0.0125, -1e-7, 0.1}, {0.01, 0.02, -0.03}};
  store.write({"polhem", "A-0017", axis_offsets(offset)});
  const auto read = pose_offset(store.read("polhem", "A-0017").value().offsets);
  REQUIRE(read);
  CHECK(read->position_m == offset.position_m);
  CHECK(read->rotation_rad == offset.rotation_rad);
  CHECK_FALSE(pose_offset({{"joint_1", 0.5}}));  // calibration of a device with joints

  RandomValues random(12);
  for (int i = 0; i < 100; ++i) {
    const Pose reported = random.pose(), known = random.pose();
    const Pose X = corrected(reported, offset_between(reported, known));
    CHECK((X.translation_m - known.translation_m).norm() < 1e-12);
    CHECK(X.rotation.angularDistance(known.rotation) < 1e-7);
  }
}

TEST_CASE("a pose outside the workspace fails homing", "[homing]") {
  HomingPlan plan;
  plan.workspace_min_m = {-0.1, -0.2, 0.0};
  plan.workspace_max_m = {0.1, 0.2, 0.3};
  plan.max_rotation_rad = 1.0;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Bad {
    Pose X_BH;
    std::size_t axis;
  };
  const auto turned = [](double angle) { return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ())); };
  for (const Bad& bad : {Bad{{turned(0), {0.11, 0, 0.1}}, 0}, Bad{{turned(0), {0, -0.21, 0.1}}, 1},
                         Bad{{turned(0), {0, 0, -0.01}}, 2}, Bad{{turned(1.1), {0, 0, 0.1}}, 5},
                         Bad{{turned(0), {nan, 0, 0.1}}, 0}}) {
    Bench bench(plan);
    bench.X_BH.translation_m.z() = 0.1;
    bench.hold(0.5);
    REQUIRE(bench.state().step == HomingStep::moving);
    bench.X_BH = bad.X_BH;
    bench.tick();
    CHECK(bench.state().step == HomingStep::failed);
    CHECK(bench.state().problem == HomingProblem::outside_workspace);
    CHECK(bench.state().axis == bad.axis);
    bench.X_BH = {};
    bench.hold(1.0);
    CHECK(bench.state().step == HomingStep::failed);  // until the operator restarts it
    bench.homing.restart();
    bench.X_BH.translation_m.z() = 0.1;
    bench.follow_all_instructions();
    CHECK(is_done(bench.homing));
  }
}

TEST_CASE("a fault pauses the step, and a lost device restarts homing", "[homing]") {
  Bench bench;
  Fault fault = Fault::none;
  bench.spoil = [&](DeviceSample& s) { s.fault = fault; };
  fault = Fault::sample_stale;
  bench.tick();
  CHECK(bench.state().step == HomingStep::awaiting_sample);
  CHECK(holds(operator_instruction(bench.state()), "Waiting for the device to report."));
  CHECK(holds(operator_instruction(bench.state()), std::string(fault_row(Fault::sample_stale).message)));
  fault = Fault::none;
  bench.hold(0.5);
  bench.move(0, 0.03);
  bench.hold(0.5);
  REQUIRE(bench.state().step == HomingStep::moving);
  REQUIRE(bench.state().axis == 1);

  fault = Fault::pose_jumped;
  bench.X_BH.translation_m.y() += 0.1;  // a jump is no motion of the hand
  bench.tick();
  fault = Fault::none;
  bench.tick();
  CHECK(bench.state().step == HomingStep::holding_still);
  CHECK(bench.state().axis == 1);

  fault = Fault::device_lost;
  bench.tick();
  CHECK(bench.state().step == HomingStep::awaiting_sample);
  fault = Fault::none;
  bench.follow_all_instructions();
  CHECK(is_done(bench.homing));
  fault = Fault::overspeed;  // the servo loop handles the consequences
  bench.tick();
  CHECK(is_done(bench.homing));
  fault = Fault::device_lost;
  bench.tick();
  CHECK_FALSE(is_done(bench.homing));
}

/// The simulated device with its reports, in a hand that performs all motions that homing requests, in order.
struct SimulatedBench {
  explicit SimulatedBench(const DeviceProfile& profile)
      : simulation(reference_profile(), obedient_hand()),
        link(simulation, clock, obedient_hand()),
        device(profile, link) {
    device.open();
    device.read_newest(clock.now());
  }

  static SimulationSettings obedient_hand() {
    SimulationSettings s;
    s.hand_repeats = false;
    Waypoint at;
    s.hand_path = {at};
    for (Eigen::Index axis = 0; axis < 6; ++axis) {
      at.time_s += 1.0;  // long enough to count as still
      s.hand_path.push_back(at);
      at.time_s += 0.8;
      (axis < 3 ? at.position_m : at.rotation_vector_rad)[axis % 3] += axis < 3 ? 0.03 : 0.35;
      s.hand_path.push_back(at);
      at.time_s += 0.8;  // and back, so that only one axis rotates at a time
      (axis < 3 ? at.position_m : at.rotation_vector_rad)[axis % 3] = 0.0;
      s.hand_path.push_back(at);
    }
    return s;
  }
  void run() {
    while (clock.now() < TimePoint{} + std::chrono::seconds(20) &&
           homing.state().step != HomingStep::failed) {
      clock.sleep_until(clock.now() + std::chrono::milliseconds(1));
      homing.advance(device.read_newest(clock.now()), clock.now());
    }
  }

  VirtualClock clock;
  SimulatedDevice simulation;
  LoopbackLink link;
  ProfileDevice device;
  Homing homing{HomingPlan{}};
};

TEST_CASE("the simulated device is homed through its reports, and a wrong profile is not", "[homing]") {
  SimulatedBench good(reference_profile());
  good.run();
  CHECK(good.homing.state() == HomingState{HomingStep::done});

  DeviceProfile profile = reference_profile();
  profile.pose_report.linear_velocity.step *= -1.0;
  SimulatedBench backward(profile);
  backward.run();
  CHECK(backward.homing.state() == HomingState{HomingStep::failed, HomingProblem::velocity_sign_mismatch});

  profile = reference_profile();
  profile.pose_report.position.step *= -1.0;
  SimulatedBench mirrored(profile);
  mirrored.run();
  CHECK(mirrored.homing.state().step == HomingStep::failed);
  CHECK(mirrored.homing.state().axis == 0);  // x moved in the wrong direction; this hand does not repeat it
}

TEST_CASE("homing ignores samples that are not fresh", "[homing]") {
  Bench bench;
  bench.spoil = [](DeviceSample& s) { s.fresh = false; };
  bench.hold(5.0);
  CHECK(bench.state().step == HomingStep::awaiting_sample);
}

TEST_CASE("homing asks only for sensed axes", "[homing]") {
  HomingPlan plan;
  plan.sensed = {true, true, true, false, false, false};
  Bench bench(plan);
  bench.follow_all_instructions();
  CHECK(is_done(bench.homing));
  CHECK(bench.instructions.size() == 8);
  plan.sensed = {false, false, false, false, false, true};
  Bench turn(plan);
  turn.follow_all_instructions();
  CHECK(is_done(turn.homing));
  CHECK(turn.instructions.at(1) == "Turn the handle to the left, counterclockwise as seen from above.");
}

TEST_CASE("an invalid homing plan is rejected", "[homing]") {
  const auto rejected = [](const std::function<void(HomingPlan&)>& spoil) {
    HomingPlan plan;
    spoil(plan);
    try {
      const Homing homing(plan);
    } catch (const std::invalid_argument& error) {
      return holds(error.what(), "homing plan: ");
    }
    return false;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(rejected([](HomingPlan&) {}));
  CHECK(rejected([](HomingPlan& p) { p.sensed = {}; }));
  CHECK(rejected([](HomingPlan& p) { p.travel_m = 0.0; }));
  CHECK(rejected([=](HomingPlan& p) { p.travel_m = nan; }));
  CHECK(rejected([](HomingPlan& p) { p.travel_rad = 3.0; }));
  CHECK(rejected([](HomingPlan& p) { p.workspace_max_m.y() = -1.0; }));
  CHECK(rejected([=](HomingPlan& p) { p.workspace_min_m.x() = nan; }));
  CHECK(rejected([](HomingPlan& p) { p.max_rotation_rad = 0.1; }));
  CHECK(rejected([=](HomingPlan& p) { p.max_offset_m = nan; }));
  CHECK(rejected([](HomingPlan& p) { p.X_BR.rotation.w() = 2.0; }));
}

TEST_CASE("homing is real-time safe for arbitrary samples", "[homing]") {
  RandomValues random(13);
  HomingPlan plan = with_reference(ReferenceSchedule::each_start);
  plan.confirm_buttons = 1;
  Homing homing(plan);
  std::uint64_t forbidden = 0;
  int armed = 0;
  TimePoint now{};
  for (int i = 0; i < 100'000; ++i) {
    DeviceSample sample;
    sample.X_BH = random.pose(0.1);
    if (random.chance(0.01)) sample.X_BH.translation_m.x() = std::numeric_limits<double>::quiet_NaN();
    sample.V_BH = random.velocity();
    sample.device_time_s = random.normal();  // the clock may jump too
    sample.fresh = random.chance(0.9);
    sample.buttons = static_cast<std::uint32_t>(random.bits() & 1U);
    if (random.chance(0.001)) sample.fault = static_cast<Fault>(random.integer(0, 8));
    now += std::chrono::milliseconds(random.integer(0, 400));
    if (random.chance(0.001)) homing.restart();
    const RealtimeGuard guard;
    homing.advance(sample, now);
    forbidden += guard.allocations() + guard.locks();
    armed += is_done(homing);
  }
  CHECK(forbidden == 0);
  CHECK(armed == 0);  // noise is no motion of the hand
}

}  // namespace
}  // namespace wrenchd::test_homing
