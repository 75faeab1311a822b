// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <dlfcn.h>
#include <unistd.h>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "tests/bench/boxes_peer_interface.h"
#include "tests/bench/statistics.hpp"
#include "tests/bench/stopwatch.hpp"
#include "tests/bench/table.hpp"
#include "tests/support/random_values.hpp"

// Boxes on a plane: wrenchd's free bodies beside other simulators, on the same scenes with the same step.
// Time, overlap, drift and the errors against closed forms. Then the time of wrenchd alone for bodies of fine
// meshes that a tool pushes.

namespace {

using namespace wrenchd;
using namespace wrenchd::bench;

constexpr double kStep_s = 1e-3;
constexpr double kGravity_m_per_s2 = 9.81;
/// Depth above which two boxes overlap, beyond the rounding of this file's test [m].
constexpr double kRounding_m = 1e-13;

struct Box {
  Vector3d half_sides_m;
  double mass_kg = 0.1;
  Pose X_WB;
  Vector3d velocity_m_per_s = Vector3d::Zero();
};

struct BoxScene {
  std::string name;
  std::vector<Box> boxes;
  double friction = 0.5;
  Vector3d gravity_m_per_s2 = {0.0, 0.0, -kGravity_m_per_s2};
  double seconds = 1.0;
};

struct BoxState {
  Pose X_WB;
  Vector3d velocity_m_per_s, spin_rad_per_s;
};

/// A simulator that runs a scene.
class Simulator {
 public:
  Simulator() = default;
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;
  virtual ~Simulator() = default;
  virtual void step() = 0;
  virtual BoxState state(std::size_t box) const = 0;
};

class Wrenchd final : public Simulator {
 public:
  explicit Wrenchd(const BoxScene& scene)
      : scene_(tool_body(make_mesh({"box", 12, 1, Vector3d::Constant(0.01)}), 1.0, 0.1),
               {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}}) {
    std::vector<FreeBody> bodies;
    for (const Box& box : scene.boxes) {
      FreeBody body;
      body.body = tool_body(make_mesh({"box", 12, 1, 2.0 * box.half_sides_m}), 1.0, box.mass_kg);
      body.motion.X_WB = box.X_WB;
      body.motion.velocity_W_m_per_s = box.velocity_m_per_s;
      body.friction = scene.friction;
      bodies.push_back(std::move(body));
    }
    BodyWorld::Settings settings;
    settings.gravity_W_m_per_s2 = scene.gravity_m_per_s2;
    settings.sleeps = false;
    world_ = std::make_unique<BodyWorld>(scene_, std::move(bodies), settings);
  }

  void step() override { world_->step(std::nullopt, kStep_s); }
  BoxState state(std::size_t box) const override {
    const BodyMotion& motion = world_->motion(box + 1);
    return {motion.X_WB, motion.velocity_W_m_per_s, angular_velocity_W(world_->inertia(box + 1), motion)};
  }

 private:
  Scene scene_;
  std::unique_ptr<BodyWorld> world_;
};

/// The shared module of a peer. It stays loaded; some peers crash when they are unloaded.
struct PeerBoxes {
  decltype(&peer_boxes_name) name = nullptr;
  decltype(&peer_boxes_open) open = nullptr;
  decltype(&peer_boxes_close) close = nullptr;
  decltype(&peer_boxes_step) step = nullptr;
  decltype(&peer_boxes_state) state = nullptr;

  /// Returns false if the module was not built.
  bool load(const std::filesystem::path& file) {
    void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) return false;
    find(library, name, "peer_boxes_name");
    find(library, open, "peer_boxes_open");
    find(library, close, "peer_boxes_close");
    find(library, step, "peer_boxes_step");
    find(library, state, "peer_boxes_state");
    return name != nullptr && open != nullptr && close != nullptr && step != nullptr && state != nullptr;
  }

 private:
  template <class Function>
  static void find(void* library, Function*& function, const char* symbol) {
    function = reinterpret_cast<Function*>(dlsym(library, symbol));
  }
};

class Peer final : public Simulator {
 public:
  Peer(const PeerBoxes& module, const BoxScene& scene) : module_(module), world_(nullptr, module.close) {
    std::vector<PeerBox> boxes;
    for (const Box& box : scene.boxes) {
      PeerBox one{};
      Eigen::Map<Vector3d>(one.half_sides) = box.half_sides_m;
      one.mass = box.mass_kg;
      Eigen::Map<Vector3d>(one.position) = box.X_WB.translation_m;
      Eigen::Map<Eigen::Vector4d>(one.quaternion) = box.X_WB.rotation.coeffs();
      Eigen::Map<Vector3d>(one.velocity) = box.velocity_m_per_s;
      boxes.push_back(one);
    }
    PeerBoxScene given{boxes.data(), boxes.size(), scene.friction, {}, kStep_s};
    Eigen::Map<Vector3d>(given.gravity) = scene.gravity_m_per_s2;
    world_.reset(module.open(&given));
    if (world_ == nullptr) throw std::runtime_error(std::string(module.name()) + " rejects the scene");
  }

  void step() override { module_.step(world_.get()); }
  BoxState state(std::size_t box) const override {
    std::array<double, 7> x{};
    std::array<double, 6> v{};
    module_.state(world_.get(), box, x.data(), v.data());
    return {{Quaterniond(x[6], x[3], x[4], x[5]).normalized(), {x[0], x[1], x[2]}},
            {v[0], v[1], v[2]},
            {v[3], v[4], v[5]}};
  }

 private:
  const PeerBoxes& module_;
  std::unique_ptr<void, decltype(&peer_boxes_close)> world_;
};

/// Depth by which two boxes overlap: the least overlap of their projections on the normals of faces and of
/// pairs of edges [m]. Zero or less if they do not overlap.
double depth_m(const Box& a, const Pose& X_WA, const Box& b, const Pose& X_WB) {
  const Matrix3d A = X_WA.rotation.toRotationMatrix(), B = X_WB.rotation.toRotationMatrix();
  const Vector3d between = X_WB.translation_m - X_WA.translation_m;
  double least = std::numeric_limits<double>::infinity();
  const auto test = [&](const Vector3d& axis) {
    const double length = axis.norm();
    if (!(length > 1e-6)) return;  // parallel edges; the faces decide
    const double reach = (A.transpose() * axis).cwiseAbs().dot(a.half_sides_m) +
                         (B.transpose() * axis).cwiseAbs().dot(b.half_sides_m);
    least = std::min(least, (reach - std::abs(between.dot(axis))) / length);
  };
  for (int i = 0; i < 3; ++i) {
    test(A.col(i));
    test(B.col(i));
    for (int j = 0; j < 3; ++j) test(A.col(i).cross(B.col(j)));
  }
  return least;
}

/// Depth of a box below the plane z = 0 [m].
double depth_m(const Box& a, const Pose& X_WA) {
  return X_WA.rotation.toRotationMatrix().row(2).cwiseAbs().dot(a.half_sides_m) - X_WA.translation_m.z();
}

double energy_J(const BoxScene& scene, const Simulator& simulator) {
  double sum = 0.0;
  for (std::size_t i = 0; i < scene.boxes.size(); ++i) {
    const Box& box = scene.boxes[i];
    const BoxState state = simulator.state(i);
    const Vector3d squares = box.half_sides_m.cwiseAbs2();
    const Vector3d moments = box.mass_kg / 3.0 * (Vector3d::Constant(squares.sum()) - squares);
    const Vector3d spin_B = state.X_WB.rotation.conjugate() * state.spin_rad_per_s;
    sum += 0.5 * box.mass_kg * state.velocity_m_per_s.squaredNorm() +
           0.5 * spin_B.dot(moments.cwiseProduct(spin_B)) -
           box.mass_kg * scene.gravity_m_per_s2.dot(state.X_WB.translation_m);
  }
  return sum;
}

struct Figures {
  std::vector<double> us;
  double deepest_m = 0.0, gain_J = 0.0;
  double drift_m = 0.0;  ///< largest displacement of a box in the second half
  std::size_t poses = 0, overlapping = 0;
  Vector3d moved_m = Vector3d::Zero();           ///< displacement of the first box in the run
  Vector3d velocity_m_per_s = Vector3d::Zero();  ///< velocity of the first box at the end of the run
};

Figures run(const BoxScene& scene, Simulator& simulator, const CounterScale& scale) {
  Figures figures;
  std::vector<Pose> settled;
  double energy = energy_J(scene, simulator);
  const auto steps = static_cast<std::size_t>(std::lround(scene.seconds / kStep_s));
  for (std::size_t k = 0; k < steps; ++k) {
    const std::int64_t start = counter();
    simulator.step();
    figures.us.push_back(1e-3 * scale.ns(counter() - start));
    std::vector<Pose> now;
    for (std::size_t i = 0; i < scene.boxes.size(); ++i) now.push_back(simulator.state(i).X_WB);
    const auto count = [&](double depth) {
      ++figures.poses;
      figures.overlapping += depth > kRounding_m ? 1 : 0;
      figures.deepest_m = std::max(figures.deepest_m, depth);
    };
    for (std::size_t i = 0; i < now.size(); ++i) {
      count(depth_m(scene.boxes[i], now[i]));
      for (std::size_t j = i + 1; j < now.size(); ++j)
        count(depth_m(scene.boxes[i], now[i], scene.boxes[j], now[j]));
    }
    const double after = energy_J(scene, simulator);
    figures.gain_J += std::max(0.0, after - energy);
    energy = after;
    if (k == steps / 2) settled = now;
    if (k + 1 == steps)
      for (std::size_t i = 0; i < now.size(); ++i)
        figures.drift_m = std::max(figures.drift_m, (now[i].translation_m - settled[i].translation_m).norm());
  }
  figures.moved_m = simulator.state(0).X_WB.translation_m - scene.boxes[0].X_WB.translation_m;
  figures.velocity_m_per_s = simulator.state(0).velocity_m_per_s;
  return figures;
}

Box cube(const Vector3d& position_m, double half_m = 0.02) {
  Box box;
  box.half_sides_m = Vector3d::Constant(half_m);
  box.X_WB.translation_m = position_m;
  return box;
}

BoxScene stack(double seconds) {
  BoxScene scene{"8 boxes stacked", {}, 0.5, {0.0, 0.0, -kGravity_m_per_s2}, seconds};
  for (int k = 0; k < 8; ++k) scene.boxes.push_back(cube({1e-3 * k, 0.0, 0.0201 + 0.0401 * k}));
  return scene;
}

BoxScene pile(double seconds) {
  BoxScene scene{"8 boxes fall on a pile", {}, 0.5, {0.0, 0.0, -kGravity_m_per_s2}, seconds};
  test::RandomValues random(7);
  for (int k = 0; k < 8; ++k) {
    scene.boxes.push_back(cube({random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), 0.05 + 0.075 * k}));
    scene.boxes.back().X_WB.rotation = random.rotation();
  }
  return scene;
}

constexpr double kSlidingFriction = 0.3, kSlidingSpeed_m_per_s = 1.0;

BoxScene sliding() {
  BoxScene scene{"a box slides to rest",
                 {cube({0.0, 0.0, 0.02 + 1e-9})},
                 kSlidingFriction,
                 {0.0, 0.0, -kGravity_m_per_s2},
                 1.0};
  scene.boxes[0].velocity_m_per_s = {kSlidingSpeed_m_per_s * std::cos(0.5),
                                     kSlidingSpeed_m_per_s * std::sin(0.5), 0.0};
  return scene;
}

/// A box on a slope. The plane stays level, and gravity is turned.
BoxScene slope(double share) {
  const double angle = share * std::atan(0.5);
  return {share < 1.0 ? "a box on a slope, 0.5 % below the angle of friction"
                      : "a box on a slope, 0.5 % above the angle of friction",
          {cube({0.0, 0.0, 0.02 + 1e-9})},
          0.5,
          kGravity_m_per_s2 * Vector3d(std::sin(angle), 0.0, -std::cos(angle)),
          2.0};
}

/// Returns the error of a run against the closed form of its scene [%], or "-" if the scene has none.
std::string against_closed_form(const BoxScene& scene, const Figures& figures) {
  if (scene.name == sliding().name) {
    const double expected_m =
        kSlidingSpeed_m_per_s * kSlidingSpeed_m_per_s / (2.0 * kSlidingFriction * kGravity_m_per_s2);
    return fixed(100.0 * (figures.moved_m.norm() / expected_m - 1.0), 3);
  }
  if (scene.name == slope(1.005).name) {
    const double along = scene.gravity_m_per_s2.x() + 0.5 * scene.gravity_m_per_s2.z();
    return fixed(100.0 * (figures.velocity_m_per_s.x() / (along * scene.seconds) - 1.0), 2);
  }
  return "-";
}

/// A tool that a hand pushes into three bodies on a table, all of the same kind of mesh.
struct PushedBodies {
  std::string name, kind;
  std::uint32_t triangles;
  double pressed_m;  ///< depth of the hand below the height at which the tool touches a body that lies
};

struct PushFigures {
  std::vector<double> us;
  std::size_t contacts = 0, unfinished = 0;
};

/// Runs eight random hands for some seconds each: they sink at 50 mm/s and swing by up to 30 mm.
PushFigures push(const PushedBodies& given, double seconds, const CounterScale& scale) {
  const bool is_cube = given.kind == "box";
  const auto mesh = [&](std::uint32_t seed) {
    GeneratedMesh request;
    request.kind = given.kind;
    request.triangles = given.triangles;
    request.seed = seed;
    request.size_m = Vector3d::Constant(0.05);
    return make_mesh(request);
  };
  const Scene scene(tool_body(mesh(1), 1.0, 0.1), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
  std::vector<FreeBody> bodies(3);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    bodies[i].body = tool_body(mesh(2 + static_cast<std::uint32_t>(i)), 1.0, 0.1);
    bodies[i].friction = 0.5;
    const auto k = static_cast<double>(i);
    const double turn = 2.0 / 3.0 * std::numbers::pi * k;
    bodies[i].motion.X_WB.translation_m = is_cube
                                              ? Vector3d(0.0505 * k, 0.001 * k, 0.0251)
                                              : Vector3d(0.06 * std::cos(turn), 0.06 * std::sin(turn), 0.05);
  }
  BodyWorld::Settings settings;
  settings.tool_friction = 0.3;
  settings.sleeps = false;
  const double top_m = is_cube ? 0.075 : 0.13;
  PushFigures figures;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    test::RandomValues random(seed);
    BodyWorld world(scene, bodies, settings);
    const Vector3d centre_m = random.vector<3>(0.04), swing_m = random.vector<3>(0.03);
    const Vector3d turn = random.vector<3>(0.5);
    BodyWorld::Hand hand;
    hand.stiffness_per_s2 = 20000.0;
    hand.X_WP.translation_m = {centre_m.x(), 0.5 * centre_m.y(), top_m + 0.005};
    world.enter_tool(0, hand.X_WP);
    for (int k = 0; k < static_cast<int>(std::lround(seconds / kStep_s)); ++k) {
      const double t_s = kStep_s * k;
      hand.X_WP.translation_m = {centre_m.x() + swing_m.x() * std::sin(3.0 * t_s),
                                 0.5 * centre_m.y() + swing_m.y() * std::sin(2.3 * t_s),
                                 top_m + 0.005 - std::min(0.005 + given.pressed_m, 0.05 * t_s)};
      hand.X_WP.rotation = rotation_from(std::sin(t_s) * turn);
      const std::int64_t start = counter();
      const BodyWorld::Status status = world.step(hand, kStep_s);
      figures.us.push_back(1e-3 * scale.ns(counter() - start));
      figures.unfinished += status != BodyWorld::Status::converged ? 1 : 0;
      figures.contacts += world.contacts().size();
    }
  }
  return figures;
}

/// Starts the program again with one thread for linear algebra, unless it is so already. Every simulator has
/// one thread; the libraries below Siconos read the number of theirs when they are loaded, and threads that
/// wait for each other on a busy machine are no measure of it.
void use_one_thread(char** argv) {
  const char* const kOpenBlas = "OPENBLAS_NUM_THREADS";
  if (std::getenv(kOpenBlas) != nullptr) return;
  setenv(kOpenBlas, "1", 1);
  setenv("OMP_NUM_THREADS", "1", 1);
  execv("/proc/self/exe", argv);
}

}  // namespace

int main(int argc, char** argv) {
  use_one_thread(argv);
  CLI::App app("bench_bodies: boxes on a plane, beside other simulators; fine bodies that a tool pushes.");
  double seconds = 10.0;
  bool quick = false;
  std::filesystem::path csv;
  app.add_option("--seconds", seconds, "duration of the stack and of the pile [s]")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_flag("--quick", quick, "a second of the stack and of the pile");
  app.add_option("--csv", csv, "writes the table to this file");
  CLI11_PARSE(app, argc, argv);
  if (quick) seconds = 1.0;
  const std::filesystem::path modules = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::vector<PeerBoxes> peers;
  for (const char* name : {"mujoco_boxes", "bullet_boxes", "ode_boxes", "siconos_boxes"}) {
    PeerBoxes peer;
    if (peer.load(modules / ("bench_peer_" + std::string(name) + ".so")))
      peers.push_back(peer);
    else
      std::cerr << "not run, because its module was not built: " << name << '\n';
  }
  const CounterScale scale = calibrate_counter();
  Table table("bodies", {"p50 us", "p99 us", "max us", "p50 ratio", "overlapping %", "deepest um", "drift um",
                         "gain uJ/s", "error %"});
  for (const BoxScene& scene : {stack(seconds), pile(seconds), sliding(), slope(0.995), slope(1.005)}) {
    double p50_us = 0.0;
    const auto add = [&](const std::string& name, Simulator& simulator) {
      const Figures figures = run(scene, simulator, scale);
      const Quantiles us = quantiles(figures.us);
      if (p50_us == 0.0) p50_us = us.p50;
      const double overlapping =
          100.0 * static_cast<double>(figures.overlapping) / static_cast<double>(figures.poses);
      table.add(scene.name, name,
                {fixed(us.p50, 1), fixed(us.p99, 1), fixed(us.max, 1), fixed(us.p50 / p50_us, 2),
                 fixed(overlapping, 3), fixed(1e6 * std::max(0.0, figures.deepest_m), 3),
                 fixed(1e6 * figures.drift_m, 3), scientific(1e6 * figures.gain_J / scene.seconds),
                 against_closed_form(scene, figures)});
    };
    Wrenchd ours(scene);
    add("wrenchd", ours);
    for (const PeerBoxes& peer : peers) {
      Peer theirs(peer, scene);
      add(peer.name(), theirs);
    }
  }
  Table pushed("pushed by a tool",
               {"p50 us", "p99 us", "p99.9 us", "max us", "contacts", "steps with a shorter time %"});
  for (const PushedBodies& given :
       {PushedBodies{"three cubes of 20k, pressed by 5 mm", "box", 20'000, 0.005},
        PushedBodies{"three cubes of 20k, pressed by 50 mm", "box", 20'000, 0.05},
        PushedBodies{"three bumpy bodies of 20k, between which the tool sinks by 50 mm", "bumpy", 20'000,
                     0.05}}) {
    const PushFigures figures = push(given, quick ? 0.5 : 4.0, scale);
    const Quantiles us = quantiles(figures.us);
    const auto steps = static_cast<double>(figures.us.size());
    pushed.add(given.name, "wrenchd",
               {fixed(us.p50, 1), fixed(us.p99, 1), fixed(us.p999, 1), fixed(us.max, 1),
                fixed(static_cast<double>(figures.contacts) / steps, 1),
                fixed(100.0 * static_cast<double>(figures.unfinished) / steps, 2)});
  }
  table.print(std::cout);
  pushed.print(std::cout);
  if (!csv.empty()) write_csv(csv, {table, pushed});
  return 0;
}
