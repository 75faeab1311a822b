// SPDX-License-Identifier: GPL-3.0-or-later
// What smoothed surfaces are for: a body that rolls and slides feels no facets.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/meshes/mesh_loader.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/energy_law.hpp"

namespace wrenchd::test_smoothed_contact {

namespace {

constexpr double kTick_s = 1e-3;
constexpr double kStiffness_per_s2 = 3000.0;
constexpr double kMass_kg = 0.2;
constexpr double kSmoothing_m = 50e-6;

/// A ball of 5,120 triangles above a table: a half-space, or a box of triangles.
Scene ball_on_table(bool mesh_table, double smoothing_m) {
  SceneSettings scene;
  scene.tool.generated = GeneratedMesh{"sphere", 5120};
  scene.tool.mesh = generated_mesh_name(*scene.tool.generated);
  scene.tool.mass_kg = kMass_kg;
  scene.smoothing_m = smoothing_m;
  if (mesh_table) {
    MeshObstacleSettings table;
    table.name = "table";
    table.generated = GeneratedMesh{"box", 12, 1, {0.4, 0.4, 0.02}};
    table.mesh = generated_mesh_name(*table.generated);
    table.X_WM.translation_m = {0.0, 0.0, -0.01};
    scene.meshes.push_back(table);
  } else {
    scene.half_spaces.push_back({"table", Vector3d::UnitZ(), 0.0});
  }
  MeshLoader loader;
  return Scene(scene, loader);
}

struct Rolled {
  std::vector<double> torque_Nm;  ///< about the axis of the rolling
  std::vector<Pose> X_WQ;
  int not_converged = 0;
  double closed_path_J = 0.0;  ///< work of the hand over the whole closed path
};

/// The hand presses the ball by 2 mm and rolls it forth and back, on a closed path.
Rolled roll(const Scene& scene, double speed_m_per_s, double seconds) {
  PenetrationDepth proxy(scene, {});
  const Inertia& M = scene.tool().solid.inertia;
  constexpr double kRadius_m = 0.03;
  const auto hand = [&](double t_s) {
    const double path_m = t_s < 0.5 * seconds ? speed_m_per_s * t_s : speed_m_per_s * (seconds - t_s);
    const Quaterniond tilt = rotation_from({0.0, 0.0, 0.3});  // not along a row of vertices
    return Pose{rotation_from({0.0, path_m / kRadius_m, 0.0}) * tilt,
                {path_m - 0.05, 0.003, kRadius_m - 0.002}};
  };
  Rolled rolled;
  Pose X_WQ = hand(0.0);
  X_WQ.translation_m.z() = 0.04;
  proxy.clear_history();
  Pose X_last = hand(0.0);
  Wrench F_last;
  const int ticks = static_cast<int>(seconds / kTick_s);
  for (int k = -50; k <= ticks; ++k) {
    const Pose X_WP = hand(std::max(k, 0) * kTick_s);
    const Penetration depth = proxy.follow(X_WP, X_WQ);
    X_WQ = depth.projection.X_WQ;
    const Wrench F_T = energy_wrench(M, kStiffness_per_s2, X_WP, X_WQ);
    const Wrench F_W = {X_WP.rotation * F_T.force_N, X_WP.rotation * F_T.torque_Nm};
    if (k > 0) {
      const Wrench mean = 0.5 * (F_last + F_W);
      rolled.closed_path_J -=
          mean.force_N.dot(X_WP.translation_m - X_last.translation_m) +
          mean.torque_Nm.dot(rotation_vector(X_WP.rotation * X_last.rotation.conjugate()));
    }
    X_last = X_WP;
    F_last = F_W;
    if (k < 0) continue;
    rolled.torque_Nm.push_back(F_W.torque_Nm.y());
    rolled.X_WQ.push_back(X_WQ);
    rolled.not_converged += depth.projection.status == ProjectionStatus::converged ? 0 : 1;
  }
  return rolled;
}

/// Root of the mean square of the parts above a frequency.
double rms_above(const std::vector<double>& signal, double from_Hz) {
  const std::size_t n = signal.size();
  double power = 0.0;
  for (std::size_t k = 1; k <= n / 2; ++k) {
    if (static_cast<double>(k) / (static_cast<double>(n) * kTick_s) < from_Hz) continue;
    std::complex<double> sum = 0.0;
    const std::complex<double> step =
        std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n));
    std::complex<double> turn = 1.0;
    for (const double x : signal) {
      sum += x * turn;
      turn *= step;
    }
    power += 2.0 * std::norm(sum) / static_cast<double>(n * n);
  }
  return std::sqrt(power);
}

double largest_distance_m(const Rolled& a, const Rolled& b) {
  double most_m = 0.0;
  for (std::size_t i = 0; i < a.X_WQ.size(); ++i)
    most_m = std::max(most_m, (a.X_WQ[i].translation_m - b.X_WQ[i].translation_m).norm());
  return most_m;
}

}  // namespace

TEST_CASE("tool, obstacles and free bodies are smoothed, for meshes and for half-spaces",
          "[smoothed_contact]") {
  const auto sphere = [] {
    GeneratedMesh made;
    made.kind = "sphere";
    made.triangles = 80;
    return made;
  };
  SceneSettings settings;
  settings.tool.generated = sphere();
  settings.tool.mesh = generated_mesh_name(sphere());
  settings.half_spaces.push_back({"table", Vector3d::UnitZ(), -0.1});
  MeshObstacleSettings obstacle;
  obstacle.name = "obstacle";
  obstacle.generated = sphere();
  obstacle.mesh = generated_mesh_name(sphere());
  obstacle.X_WM.translation_m = {0.2, 0.0, 0.0};
  settings.meshes.push_back(obstacle);
  BodySettings body;
  body.name = "body";
  body.shape = settings.tool;
  body.X_WM.translation_m = {-0.2, 0.0, 0.0};
  settings.bodies.push_back(body);
  MeshLoader loader;
  const Scene coarse(settings, loader);
  settings.smoothing_m = 1e-3;
  const Scene smooth(settings, loader);
  const auto grows = [](std::size_t from, std::size_t to) { return to > 20 * from; };
  CHECK(
      grows(coarse.tool_mesh()->surface.triangles().size(), smooth.tool_mesh()->surface.triangles().size()));
  CHECK(grows(coarse.tool().hull.vertices_T_m.size(), smooth.tool().hull.vertices_T_m.size()));
  CHECK(grows(coarse.meshes()[0].mesh->surface.triangles().size(),
              smooth.meshes()[0].mesh->surface.triangles().size()));
  const FreeBody &before = coarse.bodies()[0], &after = smooth.bodies()[0];
  CHECK(grows(before.mesh->surface.triangles().size(), after.mesh->surface.triangles().size()));
  CHECK(grows(before.body.hull.vertices_T_m.size(), after.body.hull.vertices_T_m.size()));
  CHECK(after.body.mesh.triangles.size() == before.body.mesh.triangles.size());  // shown as loaded
  CHECK(after.body.solid.inertia.mass_kg == before.body.solid.inertia.mass_kg);
  CHECK(loader.simplifications().back().find("smoothed surface of") != std::string::npos);
}

TEST_CASE("smoothing takes the facets of a rolling ball out of the torque", "[smoothed_contact][long]") {
  const Scene faceted = ball_on_table(false, 0.0), round = ball_on_table(false, kSmoothing_m);
  // speed, and by how much the torque above 30 Hz must fall; at 0.05 m/s the facets come at 26 Hz
  for (const auto& [speed_m_per_s, factor] :
       {std::pair(0.05, 5.0), std::pair(0.15, 10.0), std::pair(0.3, 10.0)}) {
    const Rolled coarse = roll(faceted, speed_m_per_s, 1.2), smooth = roll(round, speed_m_per_s, 1.2);
    const double before_Nm = rms_above(coarse.torque_Nm, 30.0), after_Nm = rms_above(smooth.torque_Nm, 30.0);
    const double moved_m = largest_distance_m(coarse, smooth);
    INFO(speed_m_per_s << " m/s: " << 1e3 * before_Nm << " to " << 1e3 * after_Nm << " mN.m, moved by "
                       << 1e6 * moved_m << " um");
    CHECK(before_Nm > factor * after_Nm);
    CHECK(before_Nm > 0.25e-3);
    CHECK(moved_m <= kSmoothing_m);
    CHECK(moved_m > 0.2 * kSmoothing_m);
    CHECK(smooth.not_converged == 0);
    CHECK(std::abs(smooth.closed_path_J) < 1e-6);
  }
}

TEST_CASE("smoothing halves the facets of a ball that rolls on a mesh", "[smoothed_contact][long]") {
  const Rolled coarse = roll(ball_on_table(true, 0.0), 0.15, 1.2);
  const Rolled smooth = roll(ball_on_table(true, kSmoothing_m), 0.15, 1.2);
  const double before_Nm = rms_above(coarse.torque_Nm, 30.0), after_Nm = rms_above(smooth.torque_Nm, 30.0);
  INFO(1e3 * before_Nm << " to " << 1e3 * after_Nm << " mN.m");
  CHECK(before_Nm > 2.0 * after_Nm);
  CHECK(smooth.not_converged <= 12);  // of 1,200 ticks
}

}  // namespace wrenchd::test_smoothed_contact
