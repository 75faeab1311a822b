// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/pressed_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "tests/support/random_body.hpp"

namespace wrenchd::bench {
namespace {

constexpr double kPressTick_s = 1e-3;
constexpr double kBaseRadius_m = 0.03;
/// Over the base the bowl rises by less than 1 mm, so the tilt of the path changes which vertex is the
/// lowest.
constexpr double kBowlRadius_m = 0.5;
constexpr double kBowlTilt_rad = 0.05;
constexpr double kFaceTilt_rad = 0.002;

/// Appends the corners of a regular polygon with its normal along z.
void add_polygon(std::size_t corners, double radius_m, double height_m, std::vector<Vector3d>& points) {
  for (std::size_t i = 0; i < corners; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(corners);
    points.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), height_m);
  }
}

/// Appends points spaced by the golden angle, which distributes any number of points evenly over a disc. Each
/// point has a different radius.
void add_bowl(std::size_t count, std::vector<Vector3d>& points) {
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (std::size_t i = 0; i < count; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double radius = kBaseRadius_m * std::sqrt(share);
    const double angle = golden * static_cast<double>(i);
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle),
                        radius * radius / (2.0 * kBowlRadius_m));
  }
}

/// Returns the hand's pose at time t. The hand moves in circles at 0.2 m/s, spins and, on the bowl, tilts at
/// 1 rad/s in total.
Pose sliding(double t, double tilt_rad) {
  const double speed_m_per_s = 0.2;
  const double around = 4.0 * t;
  const double spin = 0.7 * t;
  const Vector3d tilt(tilt_rad * std::sin(12.6 * t), tilt_rad * std::cos(9.8 * t), 0.0);
  Pose X_WP;
  X_WP.rotation = rotation_from(tilt) * rotation_from(Vector3d(0.0, 0.0, spin));
  X_WP.translation_m = speed_m_per_s / 4.0 * Vector3d(std::cos(around), std::sin(around), 0.0);
  return X_WP;
}

/// Returns the height of the count-th lowest vertex of the tool above the plane z = 0 [m]; infinity if the
/// tool has fewer vertices.
double height_of_lowest_m(const ToolBody& tool, const Pose& X_WP, std::size_t count) {
  std::vector<double> heights;
  for (const Vector3d& p : tool.hull.vertices_T_m) heights.push_back((X_WP * p).z());
  if (count > heights.size()) return std::numeric_limits<double>::infinity();
  std::sort(heights.begin(), heights.end());
  return heights[count - 1];
}

/// Returns a pressed body. base: the vertices below the plane. Above the plane the body widens to 90 mm and
/// ends at a height of 100 mm.
PressedBody pressed(std::string name, std::vector<Vector3d> base, double tilt_rad, std::size_t poses) {
  const std::size_t contacts = base.size();
  add_polygon(8, 1.5 * kBaseRadius_m, 0.04, base);
  add_polygon(4, 0.5 * kBaseRadius_m, 0.1, base);
  ToolBody tool = test::tool_of(base, 0.2);
  if (tool.hull.vertices_T_m.size() != base.size()) throw std::logic_error(name + ": a vertex is no corner");

  std::vector<Pose> X_WP;
  for (std::size_t i = 0; i < poses; ++i) {
    const double t = kPressTick_s * static_cast<double>(i);
    // Depth of the highest vertex of the base.
    const double cover_m = 1e-3 * (0.5 + 0.4 * std::sin(25.0 * t));
    Pose X = sliding(t, tilt_rad);
    X.translation_m.z() -= height_of_lowest_m(tool, X, contacts) + cover_m;
    if (height_of_lowest_m(tool, X, contacts + 1) <= 0.0)
      throw std::logic_error(name + ": more than the base is below the plane");
    X_WP.push_back(X);
  }
  return {std::move(name), Scene(std::move(tool), {test::half_space(Vector3d::UnitZ(), 0.0)}),
          std::move(X_WP)};
}

}  // namespace

PressedBody pressed_bowl(std::size_t contacts, std::size_t poses) {
  std::vector<Vector3d> base;
  add_bowl(contacts, base);
  return pressed("bowl " + std::to_string(contacts), std::move(base), kBowlTilt_rad, poses);
}

PressedBody pressed_face(std::size_t contacts, std::size_t poses) {
  std::vector<Vector3d> base;
  add_polygon(contacts, kBaseRadius_m, 0.0, base);
  return pressed("face " + std::to_string(contacts), std::move(base), kFaceTilt_rad, poses);
}

}  // namespace wrenchd::bench
