// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tests/support/fault_rig.hpp"
#include "tests/support/random_values.hpp"

// Random fault schedules: one to four overlapping faults, in any state, with random commands in between. The
// program checks every tick against the invariants. At the end the device works again, the program
// acknowledges the fault, and the loop must become ready to arm.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

struct Outcome {
  std::uint64_t ticks = 0;
  std::string broken;
};

/// Puts a box that moves by itself between the tool and the table.
void add_box(RunConfig& plan) {
  BodySettings box;
  box.name = "box";
  box.shape.generated = GeneratedMesh{"box", 12, 1, {0.08, 0.08, 0.02}};
  box.shape.mass_kg = 0.2;
  box.X_WM.translation_m = {0.0, 0.0, 0.0101};
  plan.scene.bodies.push_back(box);
}

/// Opens a lost device again, as the daemon does.
void open_lost_device(FaultRig& rig) {
  if (!rig.raised(Fault::device_lost)) return;
  rig.faulty_device.write_result = Fault::none;
  try {
    rig.faulty_device.open();
  } catch (const std::runtime_error&) {  // the device is still unplugged
  }
}

/// The second hand: it holds and lets go, and is armed again after a fault.
void act_on_other(FaultRig& other, RandomValues& random) {
  RequestInbox& requests = other.loop.requests();
  if (random.integer(0, 60) == 0) requests.request(random.integer(0, 1) == 0 ? kGrasp : kLetGo);
  if (random.integer(0, 100) == 0) requests.request(random.integer(0, 1) == 0 ? kAcknowledge : kArm);
  open_lost_device(other);
}

/// Runs a schedule on a rig. bodies: the hand may hold a body.
Outcome run(RandomValues& random, FaultRig& rig, bool bodies) {
  const auto& states = rig_states();
  Outcome outcome;
  const State state =
      states[static_cast<std::size_t>(random.integer(0, static_cast<int>(states.size()) - 1))];
  if (!rig.bring_to(state)) {
    outcome.broken = "does not reach its state";
    return outcome;
  }
  const auto ticks_of = [&](int n) {
    for (int i = 0; i < n && rig.violation().empty(); ++i) {
      if (random.integer(0, 400) == 0)
        rig.loop.requests().request(static_cast<CommandSet>(1 << random.integer(0, 7)));
      if (random.integer(0, 40) == 0) rig.loop.requests().heartbeat();
      if (bodies && random.integer(0, 60) == 0)
        rig.loop.requests().request(random.integer(0, 1) == 0 ? kGrasp : kLetGo);
      rig.tick(random.integer(0, 300) == 0 ? from_seconds(random.uniform(0.0, 0.03))
                                           : std::chrono::milliseconds(1));
      open_lost_device(rig);
      if (rig.other != nullptr) act_on_other(*rig.other, random);
    }
  };
  const int faults = random.integer(1, 4);
  for (int f = 0; f < faults; ++f) {
    const auto& all = injections();
    all[static_cast<std::size_t>(random.integer(0, static_cast<int>(all.size()) - 1))].begin(rig);
    ticks_of(random.integer(1, 120));
    if (random.integer(0, 1) == 0) rig.faulty_device.corrupt = {};
  }
  rig.faulty_device.corrupt = {};
  rig.faulty_device.write_result = Fault::none;
  rig.clock.solver_time = Duration{0};
  ticks_of(500);
  // All planned faults end within six seconds. The program may have to open the device again.
  for (int i = 0; i < 9000 && rig.violation().empty() && rig.state() != State::disarmed; ++i) {
    if (i % 500 == 0) rig.loop.requests().request(kAcknowledge);
    rig.loop.requests().request(kDisarm);
    rig.tick();
    open_lost_device(rig);
  }
  outcome.broken = rig.violation();
  if (outcome.broken.empty() && rig.state() != State::disarmed)
    outcome.broken = std::string("does not recover: ") + name(rig.state());
  outcome.ticks = rig.last().tick + 1;
  return outcome;
}

/// Two hands, 14 cm apart, that press the same plate and hold it at times.
struct TwoRigs {
  RigClock clock;
  MeshLoader meshes;
  RunConfig first_plan, second_plan;
  std::array<HandScene, 2> scenes;
  FaultRig first, second;

  explicit TwoRigs(Phase phase)
      : first_plan(FaultRig::plan(phase, [](RunConfig& plan) { place(plan, -0.07); })),
        second_plan(FaultRig::plan(phase, [](RunConfig& plan) { place(plan, 0.07); })),
        scenes(make_hand_scenes(first_plan, second_plan, meshes)),
        first(first_plan, scenes[0], clock),
        second(second_plan, scenes[1], clock) {}

  static void place(RunConfig& plan, double x_m) {
    add_box(plan);
    plan.scene.bodies.back().shape.generated->size_m = {0.24, 0.08, 0.02};
    for (Waypoint& waypoint : plan.settings.simulation.hand_path) waypoint.position_m.x() += x_m;
  }
};

/// Runs one schedule, which its seed determines completely.
Outcome run(std::uint64_t seed, bool bodies) {
  RandomValues random(seed);
  FaultRig rig(static_cast<Phase>(random.integer(0, 2)),
               bodies ? add_box : std::function<void(RunConfig&)>());
  return run(random, rig, bodies);
}

/// The same with two hands: faults of one of them, and commands for both.
Outcome run_two_hands(std::uint64_t seed) {
  RandomValues random(seed);
  TwoRigs rigs(static_cast<Phase>(random.integer(0, 2)));
  const bool second_fails = random.integer(0, 1) == 1;
  FaultRig& failing = second_fails ? rigs.second : rigs.first;
  FaultRig& other = second_fails ? rigs.first : rigs.second;
  failing.other = &other;
  other.arms_itself = true;
  Outcome outcome = run(random, failing, true);
  if (outcome.broken.empty()) outcome.broken = other.violation();
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Random schedules of faults; checks every tick against the invariants.");
  long schedules = 1000;
  std::uint64_t seed = 1;
  app.add_option("--schedules", schedules)->check(number_in_range(1, 1e9));
  app.add_option("--seed", seed);
  bool bodies = false;
  app.add_flag("--bodies", bodies,
               "the hand presses a box that moves by itself on the table, holds it and lets go");
  bool two_hands = false;
  app.add_flag("--two-hands", two_hands, "two hands press one plate, hold it and let go")
      ->excludes("--bodies");
  CLI11_PARSE(app, argc, argv);
  std::uint64_t ticks = 0;
  long violations = 0;
  for (long i = 0; i < schedules; ++i) {
    const std::uint64_t one = seed * 1'000'003 + static_cast<std::uint64_t>(i);
    const Outcome outcome = two_hands ? run_two_hands(one) : run(one, bodies);
    ticks += outcome.ticks;
    if (outcome.broken.empty()) continue;
    if (++violations <= 20)
      std::printf("schedule %llu: %s\n", static_cast<unsigned long long>(one), outcome.broken.c_str());
  }
  std::printf("faults schedules %ld ticks %llu violations %ld seed %llu\n", schedules,
              static_cast<unsigned long long>(ticks), violations, static_cast<unsigned long long>(seed));
  return violations == 0 ? 0 : 1;
}
