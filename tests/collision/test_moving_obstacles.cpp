// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <memory>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "collision/proxy.hpp"
#include "core/metric.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_moving_obstacles {

// Moving obstacles displace the proxy, which stays admissible and passes through none of them.

namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

struct Part {
  GeneratedMesh mesh;
  Pose X_WO;
  ObstacleMotion motion;
};

Scene scene_with(const GeneratedMesh& tool, const std::vector<Part>& parts) {
  std::vector<MeshObstacle> obstacles;
  for (const Part& part : parts)
    obstacles.push_back({part.mesh.kind, MeshBvh(make_mesh(part.mesh)), part.X_WO, part.motion});
  return Scene(mesh_tool(make_mesh(tool)), {}, {}, std::move(obstacles));
}

/// A proxy that exact arithmetic checks, with the obstacles at the proxy's scene time. Their poses relative
/// to the tool are rounded by far less than the clearance.
class Watched {
 public:
  Watched(const Scene& scene, const Pose& X_WT) : X_WQ(X_WT), proxy(scene), scene_(scene) {
    for (const MeshObstacle& obstacle : scene.meshes())
      exact_.push_back(std::make_unique<ExactIntersection>(scene.tool_mesh()->surface.mesh(),
                                                           obstacle.mesh->surface.mesh()));
  }

  Projection follow(const Pose& X_WP, double time_s) {
    const Projection q = proxy.follow(X_WP, X_WQ, time_s);
    if (q.status != ProjectionStatus::infeasible) X_WQ = q.X_WQ;
    return q;
  }

  bool overlaps() const {
    for (std::size_t k = 0; k < exact_.size(); ++k)
      if (exact_[k]->intersect(inverse(scene_.meshes()[k].X_WO_at(proxy.admissible_time_s())) * X_WQ))
        return true;
    return false;
  }

  Pose X_WQ;
  Proxy proxy;

 private:
  const Scene& scene_;
  std::vector<std::unique_ptr<ExactIntersection>> exact_;
};

ObstacleMotion to_and_fro(const Vector3d& v_m_per_s, double turn_back_s) {
  ObstacleMotion motion;
  motion.linear_m_per_s = v_m_per_s;
  motion.reverse_after_s = turn_back_s;
  return motion;
}

ObstacleMotion turning(const Vector3d& w_rad_per_s) {
  ObstacleMotion motion;
  motion.angular_rad_per_s = w_rad_per_s;
  return motion;
}

TEST_CASE("a plate that flies through a hand at rest carries the proxy along, exactly outside", "[moving]") {
  const double speed_m_per_s = GENERATE(0.05, 0.5, 5.0);
  const GeneratedMesh tool =
      GENERATE(GeneratedMesh{"cube", 12}, GeneratedMesh{"bumpy", 2000}, GeneratedMesh{"plate", 100});
  const double turn_back_s = 0.12 / speed_m_per_s;
  const Scene scene = scene_with(tool, {{{"plate", 100},
                                         {Quaterniond::Identity(), {0.003, 0.002, -0.07}},
                                         to_and_fro({0, 0, speed_m_per_s}, turn_back_s)}});
  INFO(tool.kind << " at " << speed_m_per_s << " m/s");
  const Pose X_WP = {rotation_from({0.2, 0.1, 0.3}), Vector3d::Zero()};
  Watched watched(scene, X_WP);
  REQUIRE_FALSE(watched.overlaps());
  int pushed = 0;
  double latest_s = 0.0;
  const int ticks = case_count(std::min(2000, static_cast<int>(2.0 * turn_back_s / kTick_s)));
  for (int i = 1; i <= ticks; ++i) {
    const Projection q = watched.follow(X_WP, i * kTick_s);
    INFO("tick " << i << ", sweeps " << watched.proxy.sweeps());
    REQUIRE(q.status != ProjectionStatus::infeasible);
    REQUIRE_FALSE(watched.overlaps());
    const double plate_z_m = scene.meshes()[0].X_WO_at(watched.proxy.admissible_time_s()).translation_m.z();
    REQUIRE(watched.X_WQ.translation_m.z() > plate_z_m);
    pushed += q.energy > 0.0 ? 1 : 0;
    latest_s = std::max(latest_s, i * kTick_s - watched.proxy.admissible_time_s());
  }
  if (case_count(600) == 600) CHECK(pushed > ticks / 8);
  CHECK(latest_s <= 0.02);
}

TEST_CASE("a rotating gear and a tumbling block displace a tool that stays exactly outside", "[moving]") {
  const bool gear = GENERATE(true, false);
  const Scene scene =
      gear ? scene_with({"bumpy", 500}, {{{"gear", 1000}, {}, turning({0, 0, 20.0})}})
           : scene_with(
                 {"cube", 300},
                 {{{"cube", 12}, {}, turning({3.0, 5.0, 8.0})},
                  {{"plate", 100}, {Quaterniond::Identity(), {0, 0, -0.12}}, to_and_fro({0, 0, 0.1}, 0.5)}});
  HandTrajectory hand(manipulation_cases()[gear ? 11 : 8], 3);
  Pose X_WP = hand.next();
  X_WP.translation_m = gear ? Vector3d(0.12, 0, 0) : Vector3d(0.13, 0, 0);
  const Vector3d offset_m = X_WP.translation_m;
  Watched watched(scene, X_WP);
  REQUIRE_FALSE(watched.overlaps());
  int pushed = 0, late = 0;
  const int ticks = case_count(1500);
  for (int i = 1; i <= ticks; ++i) {
    X_WP = hand.next();
    X_WP.translation_m += std::max(0.0, 1.0 - i / 300.0) * offset_m;  // approach
    const Projection q = watched.follow(X_WP, i * kTick_s);
    INFO("tick " << i << ", sweeps " << watched.proxy.sweeps());
    REQUIRE_FALSE(watched.overlaps());
    REQUIRE(q.status != ProjectionStatus::infeasible);
    pushed += q.energy > 0.0 ? 1 : 0;
    late += watched.proxy.admissible_time_s() < i * kTick_s ? 1 : 0;
  }
  if (ticks == 1500) CHECK(pushed > 300);
  CHECK(late <= ticks / 20);
}

// The energy depends on p^-1 q only, so a common motion has no effect.
TEST_CASE("a hand on a moving lift gets the same contact as on the ground", "[moving]") {
  const GeneratedMesh tool = {"cube", 300};
  const Vector3d v_m_per_s(0.02, 0.01, 0.1);
  const Scene ground = scene_with(tool, {{{"table", 1200}, {}, {}}});
  const Scene lift = scene_with(tool, {{{"table", 1200}, {}, to_and_fro(v_m_per_s, 0.0)}});
  const auto hand = [](int i) {
    const double t = i * kTick_s;
    return Pose{rotation_from({0.05 * std::sin(3.0 * t), 0.0, t}),
                {0.02 * std::sin(2.0 * t), 0.0, 0.037 - 0.004 * std::min(1.0, 5.0 * t)}};
  };
  Watched still(ground, hand(0)), riding(lift, hand(0));
  REQUIRE_FALSE(still.overlaps());
  double most = 0.0;
  for (int i = 1; i <= case_count(600); ++i) {
    const Pose X = hand(i);
    const Pose X_up = {X.rotation, X.translation_m + i * kTick_s * v_m_per_s};
    const Projection q = still.follow(X, i * kTick_s);
    const Projection r = riding.follow(X_up, i * kTick_s);
    INFO("tick " << i);
    REQUIRE_FALSE(riding.overlaps());
    REQUIRE(riding.proxy.admissible_time_s() == i * kTick_s);
    CHECK(r.status == q.status);
    CHECK((log(inverse(X) * q.X_WQ) - log(inverse(X_up) * r.X_WQ)).norm() < 1e-7);
    most = std::max(most, q.energy);
  }
  if (case_count(600) == 600) CHECK(most > 1e-8);
}

TEST_CASE("a tool trapped in a vice is reported, and was outside until then", "[moving]") {
  const Scene scene =
      scene_with({"cube", 12},
                 {{{"table", 12}, {Quaterniond::Identity(), {0, 0, -0.07}}, to_and_fro({0, 0, 0.2}, 0.0)},
                  {{"table", 12}, {Quaterniond::Identity(), {0, 0, 0.07}}, to_and_fro({0, 0, -0.2}, 0.0)}});
  Watched watched(scene, {});
  REQUIRE_FALSE(watched.overlaps());
  ProjectionStatus status = ProjectionStatus::free;
  int i = 0;
  for (; i < 1000 && status != ProjectionStatus::infeasible; ++i) {
    status = watched.follow({}, (i + 1) * kTick_s).status;
    REQUIRE_FALSE(watched.overlaps());
  }
  CHECK(status == ProjectionStatus::infeasible);
  // A cube of 50 mm between tables of 20 mm: 70 - 10 - 25 leave 35 mm on either side, for 0.175 s.
  CHECK(watched.proxy.admissible_time_s() > 0.17);
  CHECK(watched.proxy.admissible_time_s() < 0.176);
  CHECK(i < 400);
  // After a reset the proxy follows again.
  const Pose beside = {Quaterniond::Identity(), {0.5, 0, 0}};
  watched.proxy.clear_history(i * kTick_s);
  watched.X_WQ = beside;
  CHECK(watched.follow(beside, (i + 1) * kTick_s).status == ProjectionStatus::free);
}

TEST_CASE("a proxy pose found for an earlier scene time catches up with the obstacles", "[moving]") {
  const Scene scene =
      scene_with({"cube", 12},
                 {{{"table", 12}, {Quaterniond::Identity(), {0, 0, -0.05}}, to_and_fro({0, 0, 0.1}, 0.0)}});
  PenetrationDepth depth(scene, {});
  const Pose X_WP;
  const Penetration placed = depth.query(X_WP, {}, 0.0);
  REQUIRE(placed.projection.status == ProjectionStatus::free);
  depth.clear_history(0.0);
  Pose X_WQ = placed.projection.X_WQ;
  Penetration now;
  for (int i = 0; i < 20; ++i) {  // the table has risen by 100 mm in the meantime
    now = depth.follow(X_WP, X_WQ, 1.0 + i * kTick_s);
    X_WQ = now.projection.X_WQ;
  }
  const double table_m = scene.meshes()[0].X_WO_at(1.0 + 19 * kTick_s).translation_m.z();
  CHECK(now.projection.status == ProjectionStatus::converged);
  CHECK(X_WQ.translation_m.z() == Approx(table_m + 0.035).margin(1e-6));
}

TEST_CASE("a moving obstacle carries the tool with friction, and not without", "[moving][friction]") {
  const ObstacleMotion motion = GENERATE(to_and_fro({0.015, 0.0, 0.02}, 0.0), turning({0.0, 0.0, 0.6}));
  const Scene scene = scene_with({"cube", 12}, {{{"table", 12}, {}, motion}});
  const double mu = GENERATE(0.0, 0.8);
  PenetrationDepth depth(scene, {Method::exact, 47, 0.0, {mu, mu}});
  const Vector3d above_m(0.02, 0.01, 0.036);
  Pose X_WQ = {Quaterniond::Identity(), above_m};
  Pose X_ride = X_WQ;  // pose of the tool if it moved with the table
  for (int i = 1; i <= 100; ++i) {
    const double t_s = i * kTick_s;
    // A hand that presses by 2 mm and stays where it is. Friction provides 1.6 mm of them.
    const double table_m = scene.meshes()[0].X_WO_at(t_s).translation_m.z();
    const Pose X_WP = {Quaterniond::Identity(),
                       above_m + Vector3d(0, 0, table_m - 0.001 - 0.002 * std::min(1.0, i / 10.0))};
    X_WQ = depth.follow(X_WP, X_WQ, t_s).projection.X_WQ;
    if (i == 20) X_ride = X_WQ;
    if (i > 20) X_ride = scene.obstacle_displacement(0, t_s - kTick_s, t_s) * X_ride;
  }
  CHECK(X_WQ.translation_m.z() ==
        Approx(scene.meshes()[0].X_WO_at(0.1).translation_m.z() + 0.035).margin(1e-7));
  const double path_m = (X_ride.translation_m - above_m).head<2>().norm() +
                        0.03 * X_ride.rotation.angularDistance(Quaterniond::Identity());
  const double behind_m = (X_ride.translation_m - X_WQ.translation_m).norm() +
                          0.03 * X_ride.rotation.angularDistance(X_WQ.rotation);
  CHECK(path_m > 1e-3);
  if (mu > 0.0)
    CHECK(behind_m < 0.02 * path_m);
  else
    CHECK(behind_m > 0.5 * path_m);
}

TEST_CASE("following moving obstacles neither allocates nor locks", "[moving][realtime]") {
  const Scene scene = scene_with({"bumpy", 2000}, {{{"gear", 1000}, {}, turning({0, 0, 5.0})}});
  Proxy proxy(scene);
  Pose X_WP = {Quaterniond::Identity(), {0.10, 0, 0}};
  Pose X_WQ = X_WP;
  const RealtimeGuard guard;
  for (int i = 1; i < case_count(400); ++i) {
    X_WP.translation_m.x() = 0.10 - 0.0002 * i;
    X_WQ = proxy.follow(X_WP, X_WQ, i * kTick_s).X_WQ;
  }
  CHECK(guard.allocations() == 0);
  CHECK(guard.locks() == 0);
}

}  // namespace
}  // namespace wrenchd::test_moving_obstacles
