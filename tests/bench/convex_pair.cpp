// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/convex_pair.hpp"

#include <cmath>
#include <stdexcept>

#include "tests/support/random_body.hpp"
#include "tests/support/separation.hpp"

namespace wrenchd::bench {
namespace {

constexpr double kTick_s = 1e-3;
constexpr double kCubeEdge_m[] = {0.060, 0.096};
constexpr double kEllipsoid_m[] = {0.035, 0.055};

ToolBody body_with(std::size_t vertices, double cube_edge_m, double ellipsoid_m, std::uint64_t seed) {
  if (vertices == 8) return test::box(Vector3d::Constant(cube_edge_m), 0.2);
  test::RandomValues random(seed);
  std::vector<Vector3d> points;
  for (std::size_t i = 0; i < vertices; ++i)
    points.push_back(random.unit<3>().cwiseProduct(ellipsoid_m * Vector3d(1.0, 0.8, 0.6)));
  return test::tool_of(points, 0.2);
}

/// Direction of the tool from the obstacle at time t.
Vector3d direction(double t) {
  const double around = t + 0.3;
  return Vector3d(std::cos(around), std::sin(around) * std::cos(0.7 * t), 0.4 * std::sin(1.7 * t) + 0.2)
      .normalized();
}

Quaterniond attitude(double t) {
  const Vector3d axis(0.3 + 0.2 * std::sin(t), 1.0, 0.5 * std::cos(t));
  return rotation_from((t + 0.15 * std::sin(9.0 * t)) * axis.normalized());
}

/// Moves the tool along u until its depth is the requested one. Uses Newton's method within a bracket; the
/// depth is concave and piecewise linear in the distance. distance_m: initial distance on input, solution on
/// output. Returns the depth at the solution.
double put_at_depth(const ConvexPair& pair, const Vector3d& u, double target_m, Pose& X_WP,
                    double& distance_m) {
  double deep = 0.0;
  double far = 1.0;
  for (int i = 0; i < 100; ++i) {
    X_WP.translation_m = distance_m * u;
    const Overlap at = overlap(pair.tool_surface_T.transformed(X_WP), pair.obstacle_surface_W);
    if (std::abs(at.depth_m - target_m) < 1e-9) return at.depth_m;
    (at.depth_m > target_m ? deep : far) = distance_m;
    const double newton = distance_m + (at.depth_m - target_m) / at.n.dot(u);
    distance_m = newton > deep && newton < far ? newton : 0.5 * (deep + far);
  }
  throw std::logic_error(pair.name + ": no pose of the depth wanted");
}

/// Checks the reference against all separating axes and all vertices on 1 % of the poses. Skips large bodies,
/// which would take seconds.
void check_reference(const ConvexPair& pair) {
  const ConvexBody& tool = pair.scene.tool().hull;
  if (tool.vertices_T_m.size() > 42) return;
  for (std::size_t i = 0; i < pair.X_WP.size(); i += 100) {
    const double depth_m = -test::separation_m(pair.scene, pair.X_WP[i]);
    if (std::abs(depth_m - pair.depth_m[i]) > 1e-12)
      throw std::logic_error(pair.name + ": the reference depth is wrong");
  }
}

}  // namespace

ConvexPair sliding_pair(std::size_t vertices, std::size_t poses) {
  ToolBody tool = body_with(vertices, kCubeEdge_m[0], kEllipsoid_m[0], 1);
  ConvexBody obstacle = body_with(vertices, kCubeEdge_m[1], kEllipsoid_m[1], 2).hull;
  const TriangleMesh tool_T = test::surface_of(tool.hull);
  const TriangleMesh obstacle_W = test::surface_of(obstacle);
  ConvexPair pair{std::to_string(vertices) + " vertices",
                  Scene(std::move(tool), {}, {convex_obstacle("", std::move(obstacle))}),
                  tool_T,
                  obstacle_W,
                  ConvexSurface(tool_T),
                  ConvexSurface(obstacle_W),
                  {},
                  {}};
  double distance_m = 0.0;
  for (std::size_t i = 0; i < poses; ++i) {
    const double t = kTick_s * static_cast<double>(i);
    Pose X_WP;
    X_WP.rotation = attitude(t);
    pair.depth_m.push_back(
        put_at_depth(pair, direction(t), 1e-3 * (0.5 + 0.4 * std::sin(25.0 * t)), X_WP, distance_m));
    pair.X_WP.push_back(X_WP);
  }
  check_reference(pair);
  return pair;
}

}  // namespace wrenchd::bench
