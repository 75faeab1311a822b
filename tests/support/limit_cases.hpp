// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "core/device_profile.hpp"
#include "core/limits.hpp"
#include "tests/support/limit_oracle.hpp"

namespace wrenchd::test {

/// A stream of inputs for a limiter, determined by a seed. It mixes ordinary ticks with adversarial ones:
/// numbers that are not finite, denormal, huge, exactly at a limit or adjacent to it; time steps that are
/// zero, negative or years long; previous wrenches outside the limits; twists that push, brake and cancel.
class LimitCases {
 public:
  explicit LimitCases(std::uint64_t seed);

  /// Creates the next case, runs the limiter and asks the oracle. Returns the violated invariant, or an empty
  /// text.
  std::string next();

  const Limited& out() const noexcept { return out_; }

  /// Returns the case that next() ran, with all digits of every number.
  std::string describe() const;

 private:
  std::uint64_t bits() noexcept;
  double uniform01() noexcept;  ///< uniform in [0, 1)
  bool chance(double probability) noexcept { return uniform01() < probability; }
  double between(double from, double to) noexcept { return from + (to - from) * uniform01(); }
  double power_of_two(int from, int to) noexcept;
  double any_double() noexcept;
  double not_finite() noexcept;
  double adjacent_double(double x) noexcept;
  Vector3d direction() noexcept;
  Vector3d requested_vector(double limit, const Vector3d& last) noexcept;
  Vector3d previous_vector(double limit) noexcept;
  Vector3d position() noexcept;
  Twist motion() noexcept;
  double authority() noexcept;
  double step_s() noexcept;
  double ceiling(double maximum) noexcept;
  void randomize_device();
  void corrupt() noexcept;

  std::uint64_t state_;
  std::uint64_t count_ = 0;
  DeviceProfile profile_;
  LimitGuarantees guarantees_;
  WrenchLimits limits_;
  Wrench last_;    ///< wrench sent last, or the value that replaces it
  Wrench before_;  ///< previous wrench of the case that ran
  LimitInput input_;
  Limited out_;
};

}  // namespace wrenchd::test
