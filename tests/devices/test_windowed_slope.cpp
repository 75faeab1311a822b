// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/windowed_slope.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_windowed_slope {

namespace {

using namespace test;

constexpr double kPeriod_s = 1e-3;

double rounded(double x, double step) {
  return step * std::round(x / step);
}

Vector3d along_x(double x) {
  return {x, 0.0, 0.0};
}

}  // namespace

TEST_CASE("the slope of an exact line is exact, after the second sample", "[velocity]") {
  RandomValues random(1);
  for (int round = 0; round < 100; ++round) {
    const Vector3d v = random.vector<3>(), x0 = random.vector<3>();
    WindowedSlope slope(1e-6);
    CHECK(slope.update(5.0, x0).norm() == 0.0);
    for (double t_s = 0.0; t_s < 0.1;) {
      t_s += random.uniform(0.2e-3, 4e-3);
      CHECK((slope.update(5.0 + t_s, x0 + t_s * v) - v).norm() < 1e-8);
      CHECK(slope.window_s() <= WindowedSlope::kMaxWindow_s + 1e-9);
    }
  }
}

TEST_CASE("slow motion uses the whole window, and the noise is that of the formula", "[velocity]") {
  RandomValues random(2);
  for (const double step_m : {5e-6, 20e-6, 100e-6}) {
    WindowedSlope slope(step_m);
    double square = 0.0, largest = 0.0;
    constexpr int kSamples = 20'000;
    const double speed_m_per_s = 3.0 * step_m / WindowedSlope::kMaxWindow_s;
    for (int i = 0; i < kSamples; ++i) {
      // Dithered rounding: independent errors of variance step^2 / 12.
      const double error_m = random.uniform(-0.5, 0.5) * step_m, t_s = i * kPeriod_s;
      const double v = slope.update(t_s, along_x(speed_m_per_s * t_s + error_m)).x() - speed_m_per_s;
      if (i < 32) continue;
      square += v * v / (kSamples - 32);
      largest = std::max(largest, std::abs(v));
    }
    const double n = WindowedSlope::kMaxWindow_s / kPeriod_s;
    CHECK(std::sqrt(square) == Approx(step_m / (kPeriod_s * std::sqrt(n * (n + 1) * (n + 2)))).epsilon(0.05));
    CHECK(largest <= 1.5 * step_m / (n * kPeriod_s));
    CHECK(slope.window_s() == Approx(WindowedSlope::kMaxWindow_s));
  }
}

TEST_CASE("an encoder on the edge of a count is at rest", "[velocity]") {
  constexpr double kStep_m = 100e-6;
  WindowedSlope slope(kStep_m);
  RandomValues random(6);
  int changes = 0;
  double last_m = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const double x_m = random.chance(0.02) ? kStep_m - last_m : last_m;
    if (x_m != last_m) ++changes;
    last_m = x_m;
    const double speed = slope.update(i * kPeriod_s, along_x(x_m)).norm();
    if (changes >= 2) CHECK(speed == 0.0);  // the first change may be the start of a motion
  }
  CHECK(changes > 20);
  // A third value is motion again.
  CHECK(slope.update(3.0, along_x(last_m + 2.0 * kStep_m)).x() > 0.0);
}

TEST_CASE("a sudden stop shortens the window to a few samples", "[velocity]") {
  constexpr double kStep_m = 20e-6;
  WindowedSlope slope(kStep_m);
  double x_m = 0.0;
  int i = 0;
  for (; i < 50; ++i) slope.update(i * kPeriod_s, along_x(rounded(x_m += 0.5 * kPeriod_s, kStep_m)));
  for (int k = 0; k < 4; ++k, ++i) slope.update(i * kPeriod_s, along_x(rounded(x_m, kStep_m)));
  CHECK(std::abs(slope.update(i * kPeriod_s, along_x(rounded(x_m, kStep_m))).x()) < 0.01);
}

TEST_CASE("the delay at constant acceleration is half the window", "[velocity]") {
  constexpr double kAcceleration = 2.0;
  WindowedSlope slope(1e-3);  // coarse, so that the window is full
  double v = 0.0, t_s = 0.0;
  for (int i = 0; i < 100; ++i) {
    t_s = i * kPeriod_s;
    v = slope.update(t_s, along_x(0.5 * kAcceleration * t_s * t_s)).x();
  }
  CHECK(v == Approx(kAcceleration * (t_s - 0.5 * slope.window_s())));
}

TEST_CASE("a gap restarts the slope, and a time that does not increase is ignored", "[velocity]") {
  WindowedSlope slope(1e-6);
  for (int i = 0; i < 10; ++i) slope.update(i * kPeriod_s, along_x(i * kPeriod_s));
  const Vector3d before = slope.update(9 * kPeriod_s, along_x(1.0));
  CHECK(before.x() == Approx(1.0));
  CHECK(slope.update(0.5, along_x(7.0)).norm() == 0.0);
  CHECK(slope.update(0.501, along_x(7.002)).x() == Approx(2.0));
}

TEST_CASE("at 8 kHz the samples span the longest window", "[velocity][realtime]") {
  WindowedSlope slope(1e-6);
  const RealtimeGuard guard;
  double v = 0.0;
  for (int i = 0; i < 1000; ++i) v = slope.update(i * 125e-6, along_x(0.3 * i * 125e-6)).x();
  CHECK(guard.allocations() == 0);
  CHECK(v == Approx(0.3));
  CHECK(slope.window_s() > 0.9 * WindowedSlope::kMaxWindow_s);
}

}  // namespace wrenchd::test_windowed_slope
