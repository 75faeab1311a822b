// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "core/finite.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_finite {

using test::RandomValues;

namespace {

constexpr std::uint64_t kExponent = 0x7ff0'0000'0000'0000;
constexpr std::uint64_t kSign = 0x8000'0000'0000'0000;

double from_bits(std::uint64_t bits) {
  return std::bit_cast<double>(bits);
}

/// One bit pattern of each class that is not a finite number: infinities, quiet and signalling NaN, payloads,
/// both signs.
const std::vector<double> kNotFiniteValues = {
    from_bits(kExponent),
    from_bits(kSign | kExponent),
    from_bits(kExponent | 1),
    from_bits(kSign | kExponent | 1),
    from_bits(kExponent | 0x0008'0000'0000'0000),
    from_bits(kSign | kExponent | 0x0008'0000'0000'0000),
    from_bits(kExponent | 0x0007'ffff'ffff'ffff),
    from_bits(kExponent | 0x000f'ffff'ffff'ffff),
    from_bits(kSign | kExponent | 0x000f'ffff'ffff'ffff),
};

}  // namespace

TEST_CASE("all infinities and NaNs are not finite", "[finite]") {
  for (const double x : kNotFiniteValues) CHECK_FALSE(is_finite(x));
}

TEST_CASE("zeros, denormals and the extremes are finite", "[finite]") {
  using Limits = std::numeric_limits<double>;
  for (const double x : {0.0, 1.0, Limits::denorm_min(), Limits::min(), Limits::max(), Limits::epsilon()}) {
    CHECK(is_finite(x));
    CHECK(is_finite(-x));
  }
}

TEST_CASE("for any bit pattern is_finite() agrees with std::isfinite", "[finite]") {
  RandomValues random(1);
  for (int i = 0; i < 200'000; ++i) {
    const std::uint64_t bits = random.bits() | (random.chance(0.5) ? kExponent : 0);
    REQUIRE(is_finite(from_bits(bits)) == std::isfinite(from_bits(bits)));
  }
}

TEST_CASE("a vector with one component that is not finite is not finite", "[finite]") {
  CHECK(is_finite(Vector3d(1.0, 2.0, 3.0)));
  CHECK(is_finite(Quaterniond::Identity()));
  CHECK(is_finite(Pose{}));
  CHECK(is_finite(Twist{}));
  CHECK(is_finite(Wrench{}));
  for (const double bad : kNotFiniteValues) {
    for (int i = 0; i < 3; ++i) {
      Vector3d v = Vector3d::Ones();
      v[i] = bad;
      CHECK_FALSE(is_finite(v));
      CHECK_FALSE(is_finite(Pose{Quaterniond::Identity(), v}));
      CHECK_FALSE(is_finite(Twist{v, Vector3d::Zero()}));
      CHECK_FALSE(is_finite(Twist{Vector3d::Zero(), v}));
      CHECK_FALSE(is_finite(Wrench{v, Vector3d::Zero()}));
      CHECK_FALSE(is_finite(Wrench{Vector3d::Zero(), v}));
    }
    for (int i = 0; i < 4; ++i) {
      Quaterniond q = Quaterniond::Identity();
      q.coeffs()[i] = bad;
      CHECK_FALSE(is_finite(q));
      CHECK_FALSE(is_finite(Pose{q, Vector3d::Zero()}));
    }
  }
}

}  // namespace wrenchd::test_finite
