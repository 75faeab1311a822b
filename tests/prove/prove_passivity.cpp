// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "collision/scene_contacts.hpp"
#include "core/energy_law.hpp"
#include "core/lag_limiter.hpp"
#include "core/limits.hpp"
#include "core/loop_measurement.hpp"
#include "core/passivity.hpp"
#include "core/stability_bound.hpp"
#include "core/undriven_motion.hpp"
#include "core/wrench_law.hpp"
#include "devices/simulation/hand_path.hpp"
#include "devices/simulation/simulated_handle.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/random_values.hpp"

// Proves that contact does not supply energy to the hand. The ledger uses the continuous plant, not the
// encoder values: in each substep it adds the work of the motors on the handle and subtracts the energy that
// the device's own viscous friction dissipates. Trajectories start at the surface, so that free motion
// contributes no credit.
//
// --senses and --drives take a device that senses more axes than it drives. Of its friction only that of the
// driven axes counts, and a third of the hand's motions are closed paths, in both senses.
//
// Each trajectory draws its own hand, delays, jitter, losses and encoder resolution. The loop first measures
// itself as the daemon does. The stiffness is a fraction of the resulting stability bound.

namespace {

using namespace wrenchd;
using test::RandomValues;

constexpr double kViolation_J = 1e-6;
constexpr int kSubsteps = 16;         ///< number of plant steps per period of the loop
constexpr double kMeasuring_s = 0.5;  ///< duration of the loop measurement before the hand moves
/// Returns the limits of the loopback profile.
DeviceProfile limits_of_the_device() {
  DeviceProfile profile;
  profile.max_force_N = 10.0;
  profile.max_torque_Nm = 0.5;
  return profile;
}
/// Ratio of position step to rotation step of the encoders.
constexpr double kEncoderLever_m = 0.1;

struct Options {
  long trajectories = 1000;
  std::uint64_t seed = 1;
  double seconds = 1.5;
  double times_bound = 0.0;  ///< stiffness as a multiple of the bound; 0: a random fraction between 0.5 and 1
  bool guarded = false;
  bool pid = false;
  std::vector<double> friction;  ///< viscous friction of the device [N.s/m, N.m.s/rad]; empty: as shipped
  double work_share = 1.0;       ///< work limit of the proxy as a fraction of the daemon's
  DofMask senses = kAllDofs, drives = kAllDofs;
  bool measured_rotation = false;  ///< renders undriven motion as measured: without the energy account
  double angular_share = 1.0;      ///< only for law pid: angular stiffness relative to the metric's
};

/// Returns the work limit for --work-share. Small meshes reach the limit of sweeps only.
Proxy::WorkLimit work_limit(const Options& options) {
  Proxy::WorkLimit limit;
  limit.sweeps = static_cast<std::uint16_t>(std::max(1.0, options.work_share * limit.sweeps));
  limit.node_visits = static_cast<std::uint32_t>(options.work_share * limit.node_visits);
  return limit;
}

/// All random parameters of a trajectory except the hand's path.
struct Circumstances {
  double period_s, report_delay_s, command_delay_s, jitter, phase_s, loss;
  double position_quantum_m, rotation_quantum_rad;
  double damping_share;  ///< fraction of the bound's budget for spring and damper that the damper takes
  double share;          ///< stiffness as a fraction of the bound
  bool post;             ///< the obstacle is a convex post; otherwise a half-space
  Pose X_HT;
  SimulationSettings hand;
};

Circumstances draw(RandomValues& random, const Options& options) {
  Circumstances c;
  c.period_s = random.chance(0.5) ? 1e-3 : 0.5e-3;
  const double travel_s = random.uniform(0.0, 3e-3), there = random.uniform(0.0, 1.0);
  c.report_delay_s = there * travel_s;
  c.command_delay_s = travel_s - c.report_delay_s;
  c.jitter = random.uniform(0.0, 0.5);
  c.phase_s = random.uniform(0.0, c.period_s);
  c.loss = random.uniform(0.0, 0.05);
  c.position_quantum_m = random.uniform(0.0, 100e-6);
  c.rotation_quantum_rad = c.position_quantum_m / kEncoderLever_m;
  c.damping_share = random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.5);
  c.share = random.uniform(0.5, 1.0);
  if (options.times_bound > 0.0) c.share = options.times_bound;
  c.post = random.chance(0.5);
  if (random.chance(0.5)) c.X_HT = {random.rotation(), random.uniform(0.0, 0.03) * random.unit<3>()};
  if (!options.friction.empty()) {
    c.hand.viscous_friction_N_s_per_m = options.friction[0];
    c.hand.viscous_friction_Nm_s_per_rad = options.friction[1];
  }
  c.hand.hand_stiffness_N_per_m = random.log_uniform(30.0, 800.0);
  c.hand.hand_damping_N_s_per_m = random.log_uniform(0.3, 8.0);
  c.hand.hand_stiffness_Nm_per_rad = random.log_uniform(0.1, 3.0);
  c.hand.hand_damping_Nm_s_per_rad = random.log_uniform(0.001, 0.03);
  return c;
}

/// The path of the hand: pushes, taps, drags, rotations and intervals with an open hand.
struct HandWay {
  std::vector<Waypoint> goals;
  std::vector<std::pair<double, double>> open_hand;  ///< intervals [from, to) with an open hand [s]

  bool holds(double t) const {
    return std::none_of(open_hand.begin(), open_hand.end(),
                        [&](const auto& open) { return t >= open.first && t < open.second; });
  }
};

/// A closed path of position and rotation that starts and ends at the same pose, one to four times round.
template <class Go>
void go_round(RandomValues& random, Vector3d& p, Vector3d& turn, const Go& go) {
  constexpr int kPoints = 24;
  const Vector3d centre = p, turn_centre = turn;
  const Vector3d linear(random.uniform(0.0, 0.002), random.uniform(0.0, 0.002), random.uniform(0.001, 0.004));
  const Vector3d angular = random.vector<3>(0.3);
  const double phase = random.uniform(0.0, 2.0 * std::numbers::pi), sense = random.chance(0.5) ? 1.0 : -1.0;
  const double period_s = random.log_uniform(0.15, 1.0);
  const int rounds = static_cast<int>(random.integer(1, 4));
  for (int i = 1; i <= rounds * kPoints; ++i) {
    const double angle = sense * 2.0 * std::numbers::pi * i / kPoints;
    p = centre - linear * (1.0 - std::cos(angle));
    turn = turn_centre + angular * (std::sin(angle + phase) - std::sin(phase));
    go(period_s / kPoints);
  }
}

/// X_WH: start of the hand, in contact with the surface below; z points up. closed: with closed paths.
HandWay hand_way(RandomValues& random, const Pose& X_WH, double seconds, bool closed) {
  HandWay way;
  const double touching_m = X_WH.translation_m.z();
  Vector3d p = X_WH.translation_m, turn = rotation_vector(X_WH.rotation);
  double t = 0.0;
  const auto go = [&](double in_s) { way.goals.push_back({t += in_s, p, turn}); };
  go(0.0);
  while (t < seconds) {
    if (closed && random.chance(1.0 / 3.0)) {
      go_round(random, p, turn, go);
      continue;
    }
    switch (random.integer(0, 3)) {
      case 0:  // push and hold
        p.z() = touching_m - random.uniform(0.0, 0.02);
        go(random.log_uniform(0.04, 0.4));
        go(random.uniform(0.05, 0.3));
        break;
      case 1:  // tap
        p.z() = touching_m - random.uniform(0.002, 0.015);
        go(random.log_uniform(0.015, 0.1));
        p.z() = touching_m + random.uniform(0.0, 0.008);
        go(random.log_uniform(0.015, 0.1));
        break;
      case 2:  // drag and rotate
        p += Vector3d(random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), 0.0);
        p.z() = touching_m - random.uniform(-0.004, 0.012);
        turn += random.vector<3>(0.1);
        go(random.log_uniform(0.04, 0.4));
        break;
      default:  // open the hand
        way.open_hand.emplace_back(t, t + 0.15);
        go(0.15);
    }
  }
  return way;
}

/// A connection with delay, jitter and loss that preserves the order.
template <class T>
class Line {
 public:
  Line(double delay_s, double jitter, double loss) : delay_s_(delay_s), jitter_(jitter), loss_(loss) {}
  void send(double now_s, const T& what, RandomValues& random) {
    const double delay_s = delay_s_ * (1.0 - jitter_ * random.uniform(0.0, 1.0));
    const bool lost = random.chance(loss_);
    last_s_ = std::max(last_s_, now_s + delay_s);
    if (!lost) under_way_.emplace_back(last_s_, what);
  }
  /// Receives the newest packet that has arrived, and its arrival time.
  bool receive(double now_s, T& what, double& arrived_s) {
    bool any = false;
    for (; !under_way_.empty() && under_way_.front().first <= now_s; under_way_.pop_front()) {
      std::tie(arrived_s, what) = under_way_.front();
      any = true;
    }
    return any;
  }

 private:
  double delay_s_, jitter_, loss_;
  double last_s_ = 0.0;
  std::deque<std::pair<double, T>> under_way_;
};

struct Report {
  Pose X_BH;
  double device_s = 0.0;
  std::uint64_t sequence = 0, taken = 0;
};
struct Command {
  Wrench F;
  std::uint64_t number = 0;
};

Vector3d rounded(const Vector3d& v, double quantum) {
  if (!(quantum > 0.0)) return v;
  return quantum * (v / quantum).array().round().matrix();
}

/// The host: the part of the servo loop between a report and a command.
class Host {
 public:
  Host(const Scene& scene, const Circumstances& c, const Options& options, const Pose& X_WP_start)
      : depth_(scene, {.work_limit = work_limit(options)}),
        M_(scene.tool().solid.inertia),
        circumstances_(c),
        options_(options),
        measured_(2.0 * c.period_s),
        law_(WrenchGains{}),
        limits_(LimitSettings{}, limits_of_the_device()),
        guard_({}, {}),
        undriven_(options.measured_rotation ? kNoDof : options.senses, options.drives,
                  {c.position_quantum_m, c.rotation_quantum_rad}),
        X_WQ_(X_WP_start) {}

  LoopMeasurement& measured() { return measured_; }
  bool in_contact() const { return in_contact_; }

  /// Sets the stiffness that the bound allows for the measured loop. Returns the translational stiffness
  /// [N/m].
  double derive_stiffness() {
    const LoopDelay loop{measured_.longest_period_s(), measured_.delay_s()};
    const SimulationSettings& s = circumstances_.hand;
    const DeviceDamping device{s.viscous_friction_N_s_per_m, s.viscous_friction_Nm_s_per_rad};
    const EncoderStep step{circumstances_.position_quantum_m, circumstances_.rotation_quantum_rad};
    // Above any bound, so that the scale alone determines the stiffness.
    constexpr double kStiff_per_s2 = 1e6;
    const double d = circumstances_.damping_share;
    Coupling coupling;
    coupling.stiffness = energy_stiffness(M_, kStiff_per_s2);
    coupling.stiffness.bottomRightCorner<3, 3>() *= options_.pid ? options_.angular_share : 1.0;
    coupling.damping = d / (1.0 - d) * (0.5 * loop.period_s + loop.delay_s) * coupling.stiffness;
    const double scale =
        circumstances_.share *
        stability_bound(device, loop, coupling, circumstances_.X_HT, options_.drives, step).scale;
    stiffness_per_s2_ = scale * kStiff_per_s2;
    WrenchGains gains;
    gains.stiffness = scale * coupling.stiffness;
    gains.damping = scale * coupling.damping;
    law_ = WrenchLaw(gains);
    undriven_.set_loop(transform_to_handle(gains.stiffness, circumstances_.X_HT),
                       loop.period_s + loop.delay_s);
    PassivityLimits caps;
    caps.delay_ticks =
        static_cast<std::size_t>(std::lround(measured_.typical_delay_s() / measured_.period_s().mean_s()));
    guard_ = PassivityGuard(device, caps);
    return stiffness_per_s2_ * M_.mass_kg;
  }

  Wrench tick(const Report& report, bool fresh) {
    const double dt_s = fresh && sampled_ ? report.device_s - device_s_ : 0.0;
    if (fresh) {
      device_s_ = report.device_s;
      sampled_ = true;
      bool moved = false;
      const auto move = [&](const Pose& X_WH) {
        before_ = {X_WQ_, F_, in_contact_};
        const SpringState spring = render(X_WH, moved ? 0.0 : dt_s);
        moved = true;
        return spring;
      };
      const auto undo = [&] {
        X_WQ_ = before_.X_WQ;
        F_ = before_.F;
        in_contact_ = before_.in_contact;
        depth_.discard_contacts();
      };
      undriven_.follow(report.X_BH, report.device_s, move, undo);
      F_ = restrict_to_dofs(F_, options_.drives);
    }
    Wrench F = F_;
    if (options_.guarded) F = guard_.limit(F_, report.X_BH, dt_s, in_contact_);
    const Wrench out = limits_.apply({F, 1.0, circumstances_.period_s, {}, Vector3d::Zero()}).F;
    if (options_.guarded) guard_.record_sent(out);
    undriven_.set_share(share_of(out, F_));
    return out;
  }

 private:
  /// Share of the requested wrench that the limits let pass, as the daemon's output stage computes it.
  static double share_of(const Wrench& sent, const Wrench& requested) {
    const auto ratio = [](const Vector3d& part, const Vector3d& whole) {
      return whole.isZero(0.0) ? 1.0 : std::min(1.0, part.norm() / whole.norm());
    };
    return std::min(ratio(sent.force_N, requested.force_N), ratio(sent.torque_Nm, requested.torque_Nm));
  }
  SpringState render(const Pose& X_WH, double dt_s) {
    const Pose X_WP = X_WH * circumstances_.X_HT;
    const Penetration depth = depth_.follow(X_WP, X_WQ_);
    X_WQ_ = depth.projection.X_WQ;
    in_contact_ = depth.contacts > 0;
    Wrench F_T = options_.pid ? law_.update(depth.spring_displacement, in_contact_, dt_s)
                              : law_.update_damping(energy_wrench(M_, stiffness_per_s2_, X_WP, X_WQ_),
                                                    depth.spring_displacement, in_contact_, dt_s);
    const double scale = lag_limiter_.scale(depth.projection.energy,
                                            depth.projection.status == ProjectionStatus::budget_spent);
    F_T = {scale * F_T.force_N, scale * F_T.torque_Nm};
    F_ = wrench_about(X_WH.translation_m, X_WP, F_T);
    SpringState spring;
    spring.known = depth.projection.status != ProjectionStatus::budget_spent;
    if (!in_contact_) return spring;
    spring.U_J = 0.5 * stiffness_per_s2_ * depth.projection.energy;
    spring.F_B = wrench_about(X_WH.translation_m, X_WP, energy_wrench(M_, stiffness_per_s2_, X_WP, X_WQ_));
    return spring;
  }

  PenetrationDepth depth_;
  Inertia M_;
  const Circumstances& circumstances_;
  const Options& options_;
  LoopMeasurement measured_;
  WrenchLaw law_;
  LagLimiter lag_limiter_;
  WrenchLimits limits_;
  PassivityGuard guard_;
  UndrivenMotion undriven_;
  double stiffness_per_s2_ = 0.0;
  Pose X_WQ_;
  Wrench F_;
  bool in_contact_ = false;
  struct {
    Pose X_WQ;
    Wrench F;
    bool in_contact = false;
  } before_;  ///< before the last rendering
  bool sampled_ = false;
  double device_s_ = 0.0;
};

/// Work of the motors on the handle less the device's friction. Credit lasts for one contact only: the ledger
/// restarts at 0 while there is neither contact nor motor force.
class Ledger {
 public:
  void add(double net_J, bool at_rest) {
    worst_J_ = std::max({worst_J_, net_J, net_J - start_J_});
    if (at_rest) start_J_ = net_J;
  }
  double worst_J() const { return worst_J_; }

 private:
  double start_J_ = 0.0, worst_J_ = 0.0;
};

TimePoint at(double t_s) {
  return TimePoint{} + from_seconds(t_s);
}

/// One trajectory with device, connections, host and motors.
class Run {
 public:
  Run(const Scene& scene, const Pose& X_WT, RandomValues& random, const Circumstances& c,
      const Options& options)
      : random_(random),
        c_(c),
        options_(options),
        seconds_(options.seconds),
        step_s_(c.period_s / kSubsteps),
        X_WH_(X_WT * inverse(c.X_HT)),
        way_(hand_way(random, X_WH_, options.seconds, partly_driven())),
        path_(way_.goals, false),
        handle_(c.hand, X_WH_, step_s_),
        host_(scene, c, options, X_WT),
        touch_(scene),
        reports_(c.report_delay_s, c.jitter, c.loss),
        commands_(c.command_delay_s, c.jitter, c.loss) {}

  double worst_J() {
    const auto measuring = static_cast<long>(kMeasuring_s / step_s_);
    const auto moving = static_cast<long>(seconds_ / step_s_);
    for (long i = 0; i < measuring; ++i) exchange(i);
    stiffness_N_per_m_ = host_.derive_stiffness();
    settled_ = true;
    for (long i = 0; i < moving; ++i) {
      exchange(measuring + i);
      move(static_cast<double>(i) * step_s_, i % kSubsteps == 0);
    }
    return ledger_.worst_J();
  }
  double stiffness_N_per_m() const { return stiffness_N_per_m_; }
  double delay_s() { return host_.measured().delay_s(); }

 private:
  void exchange(long substep) {
    const double now_s = static_cast<double>(substep) * step_s_;
    double arrived_s = 0.0;
    if (commands_.receive(now_s, command_, arrived_s) && settled_) motors_ = command_.F;
    if (substep % kSubsteps == 0) {
      const Pose seen = sensed();
      reports_.send(now_s, {seen, now_s, ++sequence_, command_.number}, random_);
    }
    if (now_s + 1e-12 >= next_tick_s_) tick(now_s);
  }

  /// Ticks are due at a fixed phase. A host without real-time scheduling is up to 20 % of a period late.
  void tick(double now_s) {
    const bool fresh = reports_.receive(now_s, report_, arrived_s_);
    if (report_.sequence > 0) {
      const Wrench F = host_.tick(report_, fresh);
      commands_.send(now_s, {F, ++number_}, random_);
      host_.measured().tick({at(now_s), at(arrived_s_), report_.device_s, report_.sequence, fresh, true,
                             report_.taken, number_});
    }
    ++ticks_;
    next_tick_s_ = (static_cast<double>(ticks_) + 0.2 * c_.jitter * random_.uniform(0.0, 1.0)) * c_.period_s +
                   c_.phase_s;
  }

  void move(double t_s, bool count_energy) {
    HandTarget goal = path_.at(from_seconds(t_s));
    if (!way_.holds(t_s)) goal = {handle_.X_BH(), handle_.V_BH()};
    handle_.step(goal, motors_);
    const bool off = motors_.force_N.isZero(0.0) && motors_.torque_Nm.isZero(0.0);
    if (partly_driven()) {
      driven_friction_J_ += driven_friction_W() * step_s_;
      ledger_.add(handle_.energy().motors_J - driven_friction_J_, count_energy && off && !host_.in_contact());
      return;
    }
    ledger_.add(handle_.energy().motors_J - handle_.energy().friction_J, count_energy && off && free());
  }
  bool partly_driven() const { return (options_.senses & options_.drives) != kAllDofs; }
  /// What the encoders report: the start rotation if the device senses none.
  Pose sensed() const {
    Pose X = {X_WH_.rotation, rounded(handle_.X_BH().translation_m, c_.position_quantum_m)};
    if ((options_.senses & kAngularDofs) != 0)
      X.rotation = rotation_from(rounded(rotation_vector(handle_.X_BH().rotation), c_.rotation_quantum_rad));
    return X;
  }
  double driven_friction_W() const {
    const Twist& V = handle_.V_BH();
    const Wrench v = restrict_to_dofs({V.linear_m_per_s, V.angular_rad_per_s}, options_.drives);
    return c_.hand.viscous_friction_N_s_per_m * v.force_N.squaredNorm() +
           c_.hand.viscous_friction_Nm_s_per_rad * v.torque_Nm.squaredNorm();
  }
  /// Uses the true pose, not the encoder values.
  bool free() {
    const Pose X_WT = handle_.X_BH() * c_.X_HT;
    touch_.select_admitting_planes(X_WT, 0.0);
    return touch_.admits(X_WT, 0.0);
  }

  RandomValues& random_;
  const Circumstances& c_;
  const Options& options_;
  double driven_friction_J_ = 0.0;
  double seconds_, step_s_;
  Pose X_WH_;
  HandWay way_;
  HandPath path_;
  SimulatedHandle handle_;
  Host host_;
  SceneContacts touch_;
  Line<Report> reports_;
  Line<Command> commands_;
  Ledger ledger_;
  Report report_;
  Command command_;
  Wrench motors_;
  bool settled_ = false;
  double stiffness_N_per_m_ = 0.0;
  double arrived_s_ = 0.0, next_tick_s_ = 0.0;
  std::uint64_t sequence_ = 0, number_ = 0, ticks_ = 0;
};

/// Returns a pose of the cube just above the surface z = 0, with a random rotation.
Pose resting(const Scene& scene, RandomValues& random) {
  Pose X_WT;
  X_WT.rotation = random.rotation(random.uniform(0.0, 0.8));
  double lowest_m = 0.0;
  for (const Vector3d& v : scene.tool().hull.vertices_T_m)
    lowest_m = std::min(lowest_m, (X_WT.rotation * v).z());
  X_WT.translation_m = {0.0, 0.0, 1e-6 - lowest_m};
  return X_WT;
}

/// The shipped cube above a floor, or above a post 40 mm wide and high. The post is a mesh, as in the daemon.
Scene scene_of(bool post) {
  const std::string cube = test::source_path("config/meshes/cube.off");
  SceneSettings settings;
  settings.tool.mesh = cube;
  settings.tool.scale = 0.001;
  settings.tool.mass_kg = 0.2;
  if (post) {
    MeshObstacleSettings& obstacle = settings.meshes.emplace_back();
    obstacle.name = "post";
    obstacle.mesh = cube;
    obstacle.scale = 0.0008;
    obstacle.X_WM.translation_m = {0.0, 0.0, -0.02};
  } else {
    settings.half_spaces.push_back({"floor", Vector3d::UnitZ(), 0.0});
  }
  return Scene(settings);
}

/// Returns the seed of trajectory n, so that each trajectory can be run alone.
std::uint64_t seed_of(std::uint64_t seed, long n) {
  return seed + static_cast<std::uint64_t>(n);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "prove_passivity: checks on the continuous plant that contact supplies no energy to the hand.");
  Options options;
  bool tell = false;
  app.add_option("--trajectories", options.trajectories)
      ->check(CLI::Range(1L, 100000000L))
      ->capture_default_str();
  app.add_option("--seed", options.seed,
                 "seed of the first trajectory; each further trajectory has the next seed")
      ->capture_default_str();
  app.add_option("--seconds", options.seconds, "duration of a trajectory [s]")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  app.add_option("--times-bound", options.times_bound,
                 "stiffness as a multiple of the bound; 0: random from 0.5 to 1")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_flag("--guard", options.guarded, "enables the passivity guard");
  app.add_flag("--pid", options.pid, "law of Eq. (16) instead of the energy law");
  app.add_option("--friction", options.friction,
                 "viscous friction of the device [N.s/m, N.m.s/rad]; default: the shipped simulated device")
      ->expected(2)
      ->check(CLI::Range(0.01, 100.0) | CLI::Range(0.0001, 1.0));
  app.add_option("--work-share", options.work_share,
                 "work limit of the proxy as a fraction of the daemon's, to make it lag")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--angular-share", options.angular_share,
                 "with --pid: angular stiffness relative to the one of the tool's inertia")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  const std::map<std::string, DofMask> axes = {
      {"6", kAllDofs}, {"5", kAllDofs & ~0b100'000}, {"3", kLinearDofs}};
  std::string senses = "6", drives = "6";
  app.add_option("--senses", senses, "axes that the device senses: 6, or 3 translations")
      ->check(CLI::IsMember(std::set<std::string>{"3", "6"}))
      ->capture_default_str();
  app.add_option("--drives", drives, "axes that it drives: 6, 5 (no torque about z), or 3 forces")
      ->check(CLI::IsMember(std::set<std::string>{"3", "5", "6"}))
      ->capture_default_str();
  app.add_flag("--measured-rotation", options.measured_rotation,
               "renders undriven motion as measured, to show what the energy account prevents");
  app.add_flag("--tell", tell, "prints the parameters of each violation");
  CLI11_PARSE(app, argc, argv);
  options.senses = axes.at(senses);
  options.drives = axes.at(drives);

  const Scene floor = scene_of(false), posted = scene_of(true);
  double worst_J = 0.0;
  std::vector<std::uint64_t> violations;
  for (long n = 0; n < options.trajectories; ++n) {
    RandomValues random(seed_of(options.seed, n));
    const Circumstances c = draw(random, options);
    const Scene& scene = c.post ? posted : floor;
    const Pose X_WT = resting(scene, random);
    Run run(scene, X_WT, random, c, options);
    const double J = run.worst_J();
    worst_J = std::max(worst_J, J);
    if (J <= kViolation_J) continue;
    violations.push_back(seed_of(options.seed, n));
    if (tell)
      std::printf(
          "seed %llu: %.3f uJ; %s, T %.1f ms, tau %.2f ms, %.0f N/m, quantum %.0f um, loss %.3f, "
          "damping %.2f, hand %.0f N/m %.1f N.s/m\n",
          static_cast<unsigned long long>(violations.back()), 1e6 * J, c.post ? "post" : "floor",
          1e3 * c.period_s, 1e3 * run.delay_s(), run.stiffness_N_per_m(), 1e6 * c.position_quantum_m, c.loss,
          c.damping_share, c.hand.hand_stiffness_N_per_m, c.hand.hand_damping_N_s_per_m);
  }
  std::printf("passivity trajectories %ld worst_uJ %.4f violations %zu seed %llu seconds %g\n",
              options.trajectories, 1e6 * worst_J, violations.size(),
              static_cast<unsigned long long>(options.seed), options.seconds);
  for (std::size_t i = 0; i < std::min<std::size_t>(violations.size(), 10) && !tell; ++i)
    std::printf("  violated: --trajectories 1 --seed %llu\n", static_cast<unsigned long long>(violations[i]));
  return violations.empty() ? 0 : 1;
}
