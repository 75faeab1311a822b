// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/shipped_config.hpp"

// Random programs act on the hand by external wrenches: springs to a robot, and programs that stall, die,
// jump, declare no energy, or push along with every motion of the hand. The ledger uses the continuous
// plant: the work of the motors on the handle. In free space it never exceeds what the program has declared;
// in contact not either, net of the friction of the device. Force, torque and their growth stay within the
// limits.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

constexpr double kViolation_J = 1e-6;
constexpr double kTick_s = 1e-3;
constexpr int kProgramsPerRun = 10;

struct Options {
  long programs = 200;
  std::uint64_t seed = 1;
  double counted = 1.0;  ///< share of the declared energy that the ledger counts
};

enum class Kind : std::uint8_t { robot, jumper, resonator, liar, silent, count };

/// Everything random about a program, except its requests.
struct Program {
  Kind kind;
  double lives_s;  ///< time until it dies without a word
  double stalls_from_s, stalls_for_s;
  int every_ticks;  ///< ticks from one request to the next
  double expires_s;
  double energy_J;  ///< declared with each request
  double force_N, torque_Nm;
  double stiffness_N_per_m;
  Vector3d robot_m_per_s;  ///< velocity of the robot that a spring ties to the hand
};

Program draw(RandomValues& random) {
  Program p;
  p.kind = static_cast<Kind>(random.integer(0, static_cast<int>(Kind::count) - 1));
  p.lives_s = random.uniform(0.05, 0.35);
  p.stalls_from_s = random.uniform(0.0, 0.4);
  p.stalls_for_s = random.chance(0.3) ? random.uniform(0.0, 0.2) : 0.0;
  p.every_ticks = static_cast<int>(random.integer(1, 20));
  p.expires_s = random.log_uniform(0.005, 0.3);
  p.energy_J = random.chance(0.3) ? 0.0 : random.log_uniform(1e-5, 0.3);
  p.force_N = random.log_uniform(0.1, 10.0);
  p.torque_Nm = random.log_uniform(0.005, 0.5);
  p.stiffness_N_per_m = random.log_uniform(20.0, 2000.0);
  p.robot_m_per_s = random.uniform(0.0, 0.5) * random.unit<3>();
  return p;
}

RunConfig config_of(RandomValues& random, bool contact) {
  RunConfig config = shipped_config();
  config.settings.servo.self_test_s = 0.05;
  config.settings.limits.soft_start_s = 0.05;
  SimulationSettings& simulation = config.settings.simulation;
  simulation.hand_repeats = false;
  simulation.hand_path.clear();
  simulation.hand_stiffness_N_per_m = random.log_uniform(30.0, 800.0);
  simulation.hand_damping_N_s_per_m = random.log_uniform(0.3, 8.0);
  Vector3d p(0.0, 0.0, 0.08);
  for (double t_s = 0.0; t_s < 20.0; t_s += random.uniform(0.1, 0.4)) {
    simulation.hand_path.push_back({t_s, p, random.vector<3>(0.2)});
    if (t_s < 0.5) continue;
    p = Vector3d(random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03),
                 0.09 + random.uniform(-0.02, 0.03));
    if (contact && random.chance(0.4)) p.z() = random.uniform(0.01, 0.03);
  }
  return config;
}

struct Totals {
  long programs = 0, violations = 0, limits_broken = 0, too_fast = 0, other_faults = 0;
  double worst_J = -1.0, delivered_J = 0.0, declared_J = 0.0;
};

/// A loop with a hand, on which one program after the other acts.
class Run {
 public:
  Run(RandomValues& random, const Options& options, Totals& totals)
      : random_(random),
        options_(options),
        totals_(totals),
        contact_(random.chance(0.5)),
        run_(config_of(random, contact_)) {
    for (int k = 0; k < 1000 && run_.state() != State::disarmed; ++k) run_.tick();
    run_.runtime.loop().requests().arm();
    for (int k = 0; k < 1000 && run_.state() != State::active; ++k) run_.tick();
  }

  bool active() const { return run_.state() == State::active; }

  void let_act(const Program& program) {
    start_J_ = ledger_J() + stored_J();
    declared_J_ = 0.0;
    worst_J_ = -1.0;
    const Vector3d tied_m = run_.simulated.X_BH().translation_m;
    const int end = static_cast<int>((program.lives_s + program.expires_s + 0.06) / kTick_s);
    for (int k = 0; k < end && active(); ++k) {
      const double t_s = k * kTick_s;
      const bool stalled = t_s >= program.stalls_from_s && t_s < program.stalls_from_s + program.stalls_for_s;
      if (t_s < program.lives_s && !stalled && k % program.every_ticks == 0)
        request(program, tied_m + t_s * program.robot_m_per_s);
      tick();
    }
    if (!active()) ++(run_.cause() == Fault::overspeed ? totals_.too_fast : totals_.other_faults);
    ++totals_.programs;
    totals_.worst_J = std::max(totals_.worst_J, worst_J_);
    totals_.violations += worst_J_ > kViolation_J ? 1 : 0;
    totals_.delivered_J += std::max(ledger_J() - start_J_, 0.0);
    totals_.declared_J += declared_J_;
    for (int k = 0; k < 60 && active(); ++k) tick();
  }

 private:
  void request(const Program& program, const Vector3d& robot_m) {
    ExternalWrenchRequest request;
    request.energy_J = program.energy_J;
    request.expires = run_.clock.now() + from_seconds(program.expires_s);
    const Twist& V_BH = run_.simulated.V_BH();
    switch (program.kind) {
      case Kind::robot:
        request.F_H_W.force_N = program.stiffness_N_per_m * (robot_m - run_.simulated.X_BH().translation_m);
        break;
      case Kind::jumper:
        request.F_H_W = {program.force_N * random_.unit<3>(), program.torque_Nm * random_.unit<3>()};
        break;
      case Kind::resonator:  // pushes along with every motion
        if (V_BH.linear_m_per_s.norm() > 0.0)
          request.F_H_W.force_N = program.force_N * V_BH.linear_m_per_s.normalized();
        if (V_BH.angular_rad_per_s.norm() > 0.0)
          request.F_H_W.torque_Nm = program.torque_Nm * V_BH.angular_rad_per_s.normalized();
        break;
      case Kind::liar:  // declares nothing, and asks for all that is possible
        request.F_H_W.force_N = 10.0 * (V_BH.linear_m_per_s.z() < 0.0 ? -1.0 : 1.0) * Vector3d::UnitZ();
        request.energy_J = 0.0;
        break;
      default:  // declares, and asks for no force
        break;
    }
    const double length_N = request.F_H_W.force_N.norm();
    if (length_N > 10.0) request.F_H_W.force_N *= 10.0 / length_N;
    declared_J_ += request.energy_J;
    run_.runtime.loop().requests().set_external_wrench(request);
  }

  void tick() {
    run_.tick();
    const double growth_N = run_.force_N() - last_N_, growth_Nm = run_.torque_Nm() - last_Nm_;
    last_N_ = run_.force_N();
    last_Nm_ = run_.torque_Nm();
    const LimitSettings limits = run_.runtime.loop().telemetry().limits();
    constexpr double kRounding = 1.0 + 1e-9;
    const bool within = last_N_ <= limits.max_force_N * kRounding &&
                        last_Nm_ <= limits.max_torque_Nm * kRounding &&
                        growth_N <= limits.force_slew_N_per_s * kTick_s * kRounding &&
                        growth_Nm <= limits.torque_slew_Nm_per_s * kTick_s * kRounding;
    totals_.limits_broken += within ? 0 : 1;
    worst_J_ = std::max(worst_J_, ledger_J() - start_J_ - options_.counted * declared_J_);
  }

  double ledger_J() const {
    const SimulatedEnergy& energy = run_.simulated.handle().energy();
    return contact_ ? energy.motors_J - energy.friction_J : energy.motors_J;
  }

  /// What the contact spring holds, and may return.
  double stored_J() const {
    if (run_.last.contacts == 0) return 0.0;
    return 0.5 * run_.last.stiffness_scale * run_.runtime.config().settings.wrench.energy_stiffness_per_s2 *
           run_.last.energy;
  }

  RandomValues& random_;
  const Options& options_;
  Totals& totals_;
  bool contact_;
  VirtualRuntime run_;
  double start_J_ = 0.0, declared_J_ = 0.0, worst_J_ = 0.0;
  double last_N_ = 0.0, last_Nm_ = 0.0;
};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Random programs act on the hand by external wrenches.");
  app.add_option("--programs", options.programs, "number of programs")->check(number_in_range(1, 1e9));
  app.add_option("--seed", options.seed, "seed of the first run");
  app.add_option("--counted", options.counted, "share of the declared energy that the ledger counts");
  CLI11_PARSE(app, argc, argv);

  Totals totals;
  for (std::uint64_t seed = options.seed; totals.programs < options.programs; ++seed) {
    RandomValues random(seed);
    Run run(random, options, totals);
    const long violations = totals.violations;
    for (int i = 0; i < kProgramsPerRun && run.active() && totals.programs < options.programs; ++i)
      run.let_act(draw(random));
    if (totals.violations > violations)
      std::printf("seed %llu: %ld violations\n", static_cast<unsigned long long>(seed),
                  totals.violations - violations);
  }
  std::printf(
      "prove_external programs %ld violations %ld worst_J %.3g limits_broken %ld overspeed %ld other_faults "
      "%ld declared_J %.3g "
      "delivered_J %.3g\n",
      totals.programs, totals.violations, totals.worst_J, totals.limits_broken, totals.too_fast,
      totals.other_faults, totals.declared_J, totals.delivered_J);
  return totals.violations + totals.limits_broken > 0 ? 1 : 0;
}
