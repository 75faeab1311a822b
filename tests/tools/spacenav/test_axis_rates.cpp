// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tools/spacenav/axis_rates.hpp"

namespace wrenchd::test_axis_rates {

namespace {

constexpr PoseNumbers kOrigin = {0, 0, 0, 0, 0, 0, 1};

void check_rates(const PoseNumbers& to, const AxisRates& expected) {
  const AxisRates rates = axis_rates(kOrigin, to, 0.01, {0.1, 1.0});
  for (std::size_t i = 0; i < 6; ++i) {
    INFO("axis " << i);
    CHECK(rates[i] == Approx(expected[i]).margin(1e-9));
  }
}

/// A turn by 0.01 rad about an axis of the world.
PoseNumbers turned(std::size_t axis, double angle_rad = 0.01) {
  PoseNumbers pose = kOrigin;
  pose[3 + axis] = std::sin(0.5 * angle_rad);
  pose[6] = std::cos(0.5 * angle_rad);
  return pose;
}

}  // namespace

// World: x forward, y left, z up. Programs: x right, y up, z away from the user.
TEST_CASE("the axes of programs are right, up and away", "[spacenav]") {
  check_rates({0.001, 0, 0, 0, 0, 0, 1}, {0, 0, 350, 0, 0, 0});  // 0.1 m/s forward
  check_rates({0, 0.001, 0, 0, 0, 0, 1}, {-350, 0, 0, 0, 0, 0});
  check_rates({0, 0, 0.001, 0, 0, 0, 1}, {0, 350, 0, 0, 0, 0});
  check_rates(turned(0), {0, 0, 0, 0, 0, 350});
  check_rates(turned(1), {0, 0, 0, -350, 0, 0});
  check_rates(turned(2), {0, 0, 0, 0, 350, 0});
}

TEST_CASE("both quaternions of a rotation are the same turn", "[spacenav]") {
  PoseNumbers other = turned(2);
  for (std::size_t i = 3; i < 7; ++i) other[i] = -other[i];
  check_rates(other, {0, 0, 0, 0, 350, 0});
}

TEST_CASE("a jump and a pose that is not finite are no motion", "[spacenav]") {
  const AxisRates none{};
  CHECK(axis_rates(kOrigin, {0.2, 0, 0, 0, 0, 0, 1}, 0.01, {}) == none);
  CHECK(axis_rates(kOrigin, turned(0, 2.0), 0.01, {}) == none);
  CHECK(axis_rates(kOrigin, {std::nan(""), 0, 0, 0, 0, 0, 1}, 0.01, {}) == none);
  CHECK(axis_rates(kOrigin, {0, 0, 0, 0, 0, 0, 0}, 0.01, {}) == none);
  CHECK(axis_rates(kOrigin, {0, 0, 0, 0, std::numeric_limits<double>::infinity(), 0, 1}, 0.01, {}) == none);
}

}  // namespace wrenchd::test_axis_rates
