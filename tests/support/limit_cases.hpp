// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "core/device_profile.hpp"
#include "core/limits.hpp"
#include "tests/support/limit_oracle.hpp"

namespace wrenchd::test {

/// A stream of ticks for a limiter, the same for the same seed: ordinary ones, and what a defect or an enemy
/// would hand in. Numbers that are not finite, denormal, huge, exactly at a limit or the next double to it;
/// steps of no time, backwards, of years; a last wrench that could never have gone out; twists that push,
/// brake and cancel.
class LimitCases {
 public:
  explicit LimitCases(std::uint64_t seed);

  /// One tick further: makes a case, runs the limiter, asks the oracle. Returns the invariant that is broken,
  /// or an empty text.
  std::string next();

  const Limited& out() const noexcept { return out_; }

  /// The case that next() ran, every number to its last digit.
  std::string describe() const;

 private:
  std::uint64_t bits() noexcept;
  double uniform01() noexcept;  ///< [0, 1)
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
  Wrench last_;    ///< what went out last, or what was put in its place
  Wrench before_;  ///< the same, of the case that ran
  LimitInput input_;
  Limited out_;
};

}  // namespace wrenchd::test
