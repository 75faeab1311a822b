// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/finite.hpp"
#include "core/limits.hpp"
#include "tests/support/random_values.hpp"

using namespace wrenchd;
using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;
constexpr double kMost = std::numeric_limits<double>::max();
constexpr double kLeast = std::numeric_limits<double>::denorm_min();

/// Room for anything but what the test is about.
LimitSettings without_slew() {
  LimitSettings s;
  s.force_slew_N_per_s = s.torque_slew_Nm_per_s = 1e30;
  return s;
}

LimitSettings slew(double force_N_per_s, double torque_Nm_per_s) {
  LimitSettings s;
  s.force_slew_N_per_s = force_N_per_s;
  s.torque_slew_Nm_per_s = torque_Nm_per_s;
  return s;
}

Wrench force(double x, double y, double z) {
  return {{x, y, z}, Vector3d::Zero()};
}
Wrench torque(double x, double y, double z) {
  return {Vector3d::Zero(), {x, y, z}};
}

/// Cosine of the angle between two vectors, of any length there is.
double cosine(const Vector3d& a, const Vector3d& b) {
  const auto unit = [](const Vector3d& v) -> Vector3d { return (v / v.cwiseAbs().maxCoeff()).normalized(); };
  return unit(a).dot(unit(b));
}

const std::vector<double> kNotFiniteValues = {
    std::bit_cast<double>(std::uint64_t{0x7ff0'0000'0000'0000}),  // infinity
    std::bit_cast<double>(std::uint64_t{0xfff0'0000'0000'0000}),
    std::bit_cast<double>(std::uint64_t{0x7ff8'0000'0000'0000}),  // quiet NaN
    std::bit_cast<double>(std::uint64_t{0xfff8'0000'0000'0000}),
    std::bit_cast<double>(std::uint64_t{0x7ff0'0000'0000'0001}),  // signalling NaN
    std::bit_cast<double>(std::uint64_t{0xfff0'0000'0000'0001}),
    std::bit_cast<double>(std::uint64_t{0x7fff'ffff'ffff'ffff}),  // all payload
    std::bit_cast<double>(std::uint64_t{0xffff'ffff'ffff'ffff}),
};

using Long3 = Eigen::Matrix<long double, 3, 1>;

/// What the limits promise of one group (force or torque) in one tick, worked out again in long double from
/// what went out last, what was asked for, and what goes out. Returns the promise that is broken, or nothing.
std::string broken_promise(const Vector3d& last_d, const Vector3d& asked_d, const Vector3d& out_d,
                           double limit, double slew_rate, double authority, double dt_s) {
  const Long3 last = last_d.cast<long double>();
  const Long3 out = out_d.cast<long double>();
  Long3 target = asked_d.cast<long double>();
  if (!is_finite(out_d)) return "finite";
  if (out.norm() > limit * (1.0L + 4e-16L)) return "within the limit";

  if (target.norm() > limit) target *= limit / target.norm();
  target *= std::fmin(std::fmax(authority, 0.0), 1.0);
  const long double growth = static_cast<long double>(slew_rate) * std::fmax(dt_s, 0.0);
  const long double rounding = 1e-14L * limit;
  if (out.norm() > last.norm() + growth + rounding) return "length grows no faster than the rate";
  if (out.norm() > target.norm() + rounding) return "no more than was asked for";

  // Of what goes out, the share along the last direction and up to the last length is free; the rest is new.
  Long3 free = Long3::Zero();
  if (last.norm() > 0.0L) {
    const Long3 along = last / last.norm();
    free = along * std::fmin(std::fmax(target.dot(along), 0.0L), last.norm());
  }
  if ((out - free).norm() > growth + rounding) return "what is new is no longer than the growth allowed";
  const Long3 wanted = target - free;
  if (wanted.norm() <= growth) {
    if ((out - target).norm() > rounding) return "what may go out goes out";
  } else {
    const Long3 rest = out - free;
    if (std::abs(rest.norm() - growth) > rounding) return "as much as the rate allows";
    if ((rest * wanted.norm() - wanted * growth).norm() > rounding * wanted.norm())
      return "straight towards the target";
  }
  return {};
}

/// A number of any kind a defect may produce: ordinary, zero, denormal, huge.
double anything(RandomValues& random) {
  switch (random.integer(0, 9)) {
    case 0:
      return 0.0;
    case 1:
      return kLeast * random.integer(-9, 9);
    case 2:
      return random.decades(1e-320, 1e-300);
    case 3:
      return -random.decades(1e100, 1e308);
    case 4:
      return random.chance(0.5) ? kMost : -kMost;
    case 5:
      return random.normal() * random.decades(1e-20, 1e20);
    default:
      return 10.0 * random.normal();
  }
}

Vector3d anything3(RandomValues& random) {
  if (random.chance(0.05)) return Vector3d::Constant(anything(random));
  return {anything(random), anything(random), anything(random)};
}

}  // namespace

TEST_CASE("what is within all limits goes out unchanged, to the bit", "[limits]") {
  RandomValues random(1);
  WrenchLimits limits(without_slew(), 10.0, 1.0);
  for (int i = 0; i < 10'000; ++i) {
    const Wrench asked{random.uniform(0.0, 9.99) * random.unit<3>(),
                       random.uniform(0.0, 0.999) * random.unit<3>()};
    const Limited out = limits.apply(asked, 1.0, kTick_s);
    REQUIRE(out.causes == kNotLimited);
    REQUIRE(out.F.force_N == asked.force_N);
    REQUIRE(out.F.torque_Nm == asked.torque_Nm);
  }
}

TEST_CASE("NaN or infinity of any kind in any slot: zero goes out, and says so", "[limits]") {
  for (const double bad : kNotFiniteValues)
    for (int slot = 0; slot < 6; ++slot) {
      WrenchLimits limits(slew(1.0, 1.0), 10.0, 1.0);
      for (int i = 0; i < 100; ++i) limits.apply(force(5.0, 0.0, 0.0), 1.0, 1.0);
      Wrench asked{{1.0, 2.0, 3.0}, {0.1, 0.2, 0.3}};
      (slot < 3 ? asked.force_N[slot] : asked.torque_Nm[slot - 3]) = bad;
      const Limited out = limits.apply(asked, 1.0, kTick_s);
      INFO("slot " << slot);
      REQUIRE(out.F.force_N == Vector3d::Zero());
      REQUIRE(out.F.torque_Nm == Vector3d::Zero());
      REQUIRE(out.causes == kNotFinite);
      // What follows grows from zero again.
      const Limited after = limits.apply(force(5.0, 0.0, 0.0), 1.0, kTick_s);
      REQUIRE(after.F.force_N.norm() == Approx(kTick_s));
      REQUIRE(after.causes == kForceSlew);
    }
}

TEST_CASE("an authority or a time that is not a number: zero goes out", "[limits]") {
  for (const double bad : kNotFiniteValues) {
    WrenchLimits limits(without_slew(), 10.0, 1.0);
    limits.apply(force(5.0, 0.0, 0.0), 1.0, kTick_s);
    const Limited by_authority = limits.apply(force(5.0, 0.0, 0.0), bad, kTick_s);
    CHECK(by_authority.causes == kNotFinite);
    CHECK(by_authority.F.force_N == Vector3d::Zero());
    const Limited by_time = limits.apply(force(5.0, 0.0, 0.0), 1.0, bad);
    CHECK(by_time.causes == kNotFinite);
    CHECK(by_time.F.force_N == Vector3d::Zero());
  }
}

TEST_CASE("too long a force or torque is shortened to its limit, in its direction", "[limits]") {
  RandomValues random(2);
  WrenchLimits limits(without_slew(), 10.0, 1.0);
  for (int i = 0; i < 20'000; ++i) {
    limits.reset();
    const Wrench asked{random.decades(10.01, 1e300) * random.unit<3>(),
                       random.decades(1.01, 1e300) * random.unit<3>()};
    const Limited out = limits.apply(asked, 1.0, kTick_s);
    REQUIRE(out.causes == (kForceMagnitude | kTorqueMagnitude));
    REQUIRE(out.F.force_N.norm() <= 10.0);
    REQUIRE(out.F.torque_Nm.norm() <= 1.0);
    REQUIRE(out.F.force_N.norm() == Approx(10.0).epsilon(1e-12));
    REQUIRE(out.F.torque_Nm.norm() == Approx(1.0).epsilon(1e-12));
    REQUIRE(cosine(out.F.force_N, asked.force_N) >= 1.0 - 1e-12);
    REQUIRE(cosine(out.F.torque_Nm, asked.torque_Nm) >= 1.0 - 1e-12);
  }
}

TEST_CASE("the longest vectors there are keep their direction too", "[limits]") {
  for (const double most : {kMost, 0.5 * kMost, 1e308, 1e200, 1e155, 1e154})
    for (const Vector3d& sign :
         {Vector3d(1, 1, 1), Vector3d(-1, 1, 0), Vector3d(0, 0, -1), Vector3d(0.5, -1, 0.25)}) {
      WrenchLimits limits(without_slew(), 10.0, 1e-3);
      const Wrench asked{most * sign, -most * sign};
      const Limited out = limits.apply(asked, 1.0, kTick_s);
      INFO(asked.force_N.transpose());
      CHECK(out.F.force_N.norm() == Approx(10.0).epsilon(1e-12));
      CHECK(out.F.torque_Nm.norm() == Approx(1e-3).epsilon(1e-12));
      CHECK(cosine(out.F.force_N, asked.force_N) >= 1.0 - 1e-12);
      CHECK(cosine(out.F.torque_Nm, asked.torque_Nm) >= 1.0 - 1e-12);
    }
}

TEST_CASE("force and torque are limited each on its own", "[limits]") {
  RandomValues random(3);
  WrenchLimits limits(without_slew(), 10.0, 1.0);
  for (int i = 0; i < 1'000; ++i) {
    const Vector3d small_force = random.uniform(0.0, 9.99) * random.unit<3>();
    const Vector3d small_torque = random.uniform(0.0, 0.999) * random.unit<3>();
    const Limited long_force = limits.apply({1e3 * random.unit<3>(), small_torque}, 1.0, kTick_s);
    REQUIRE(long_force.causes == kForceMagnitude);
    REQUIRE(long_force.F.torque_Nm == small_torque);
    const Limited long_torque = limits.apply({small_force, 1e3 * random.unit<3>()}, 1.0, kTick_s);
    REQUIRE(long_torque.causes == kTorqueMagnitude);
    REQUIRE(long_torque.F.force_N == small_force);
  }
}

TEST_CASE("settings may tighten the profile's limits, never loosen them", "[limits]") {
  const auto limits_with = [](double force_N, double torque_Nm) {
    LimitSettings s = without_slew();
    s.max_force_N = force_N;
    s.max_torque_Nm = torque_Nm;
    return WrenchLimits(s, 10.0, 1.0);
  };
  CHECK(limits_with(0.0, 0.0).max_force_N() == 10.0);  // 0: the profile's own
  CHECK(limits_with(0.0, 0.0).max_torque_Nm() == 1.0);
  CHECK(limits_with(4.0, 0.3).max_force_N() == 4.0);
  CHECK(limits_with(4.0, 0.3).max_torque_Nm() == 0.3);
  for (const double loose : {11.0, 1e9, kMost, std::numeric_limits<double>::infinity(), -5.0,
                             std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(limits_with(loose, loose).max_force_N() == 10.0);
    CHECK(limits_with(loose, loose).max_torque_Nm() == 1.0);
    WrenchLimits limits = limits_with(loose, loose);
    CHECK(limits.apply(force(100.0, 0.0, 0.0), 1.0, kTick_s).F.force_N.norm() <= 10.0);
  }
  WrenchLimits tight = limits_with(4.0, 0.3);
  CHECK(tight.apply(force(100.0, 0.0, 0.0), 1.0, kTick_s).F.force_N.norm() <= 4.0);
  CHECK(tight.apply(torque(100.0, 0.0, 0.0), 1.0, kTick_s).F.torque_Nm.norm() <= 0.3);
}

TEST_CASE("authority scales what is asked for, after the magnitude", "[limits]") {
  WrenchLimits limits(without_slew(), 10.0, 1.0);
  const Limited half = limits.apply(force(100.0, 0.0, 0.0), 0.5, kTick_s);
  CHECK(half.F.force_N.x() == Approx(5.0));
  CHECK(half.causes == (kForceMagnitude | kAuthority));
  const Limited none = limits.apply(force(3.0, 4.0, 0.0), 0.0, kTick_s);
  CHECK(none.F.force_N == Vector3d::Zero());
  CHECK(none.causes == kAuthority);
  CHECK(limits.apply(force(3.0, 4.0, 0.0), -7.0, kTick_s).F.force_N == Vector3d::Zero());
  const Limited more = limits.apply(force(3.0, 4.0, 0.0), 7.0, kTick_s);  // never more than was asked for
  CHECK(more.F.force_N == Vector3d(3.0, 4.0, 0.0));
  CHECK(more.causes == kNotLimited);
}

TEST_CASE("a force grows no faster than its rate, and arrives", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  for (int tick = 1; tick < 5; ++tick) {
    const Limited out = limits.apply(force(0.0, 10.0, 0.0), 1.0, kTick_s);
    REQUIRE(out.F.force_N.y() == Approx(2.0 * tick).epsilon(1e-14));
    REQUIRE(out.causes == kForceSlew);
  }
  limits.apply(force(0.0, 10.0, 0.0), 1.0, kTick_s);
  const Limited arrived = limits.apply(force(0.0, 10.0, 0.0), 1.0, kTick_s);
  CHECK(arrived.F.force_N.y() == Approx(10.0).epsilon(1e-14));
  CHECK(arrived.causes == kNotLimited);
}

TEST_CASE("a torque has its own rate", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  const Limited out = limits.apply({{1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}, 1.0, kTick_s);
  CHECK(out.F.force_N == Vector3d(1.0, 0.0, 0.0));
  CHECK(out.F.torque_Nm.z() == Approx(0.05).epsilon(1e-14));
  CHECK(out.causes == kTorqueSlew);
}

TEST_CASE("towards zero is free: letting go is never delayed", "[limits]") {
  RandomValues random(4);
  for (int i = 0; i < 1'000; ++i) {
    WrenchLimits limits(slew(1.0, 1.0), 10.0, 1.0);
    const Wrench full{9.0 * random.unit<3>(), 0.9 * random.unit<3>()};
    limits.apply(full, 1.0, 100.0);
    const double share = i % 3 == 0 ? 0.0 : random.uniform(0.0, 1.0);
    const Wrench less{share * full.force_N, share * full.torque_Nm};
    const Limited out = limits.apply(less, 1.0, 0.0);  // no time at all
    REQUIRE((out.F.force_N - less.force_N).norm() <= 1e-14);
    REQUIRE((out.F.torque_Nm - less.torque_Nm).norm() <= 1e-14);
  }
}

TEST_CASE("a fall of authority is free, a rise is not", "[limits]") {
  WrenchLimits limits(slew(1.0, 1.0), 10.0, 1.0);
  limits.apply(force(9.0, 0.0, 0.0), 1.0, 100.0);
  CHECK(limits.apply(force(9.0, 0.0, 0.0), 0.0, kTick_s).F.force_N.norm() == 0.0);
  CHECK(limits.apply(force(9.0, 0.0, 0.0), 1.0, kTick_s).F.force_N.norm() == Approx(1e-3));
}

TEST_CASE("a reversal: the old force is gone at once, the new one grows from zero at the rate", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  limits.apply(force(8.0, 0.0, 0.0), 1.0, 1.0);
  for (int tick = 1; tick < 4; ++tick) {
    const Limited out = limits.apply(force(-8.0, 0.0, 0.0), 1.0, kTick_s);
    REQUIRE(out.F.force_N.x() == Approx(-2.0 * tick).epsilon(1e-13));
    REQUIRE(out.causes == kForceSlew);
  }
}

TEST_CASE("a force that turns keeps what it has in common with the last", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  limits.apply(force(8.0, 0.0, 0.0), 1.0, 1.0);
  const Limited out = limits.apply(force(3.0, 7.0, 0.0), 1.0, kTick_s);  // 3 of the old, and 2 N of the new
  CHECK(out.F.force_N.x() == Approx(3.0).epsilon(1e-14));
  CHECK(out.F.force_N.y() == Approx(2.0).epsilon(1e-14));
}

TEST_CASE("a small turn of a full force passes", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  limits.apply(force(9.9, 0.0, 0.0), 1.0, 1.0);
  const double angle = 0.1;  // 1 N across, in a tick that allows 2
  const Limited out = limits.apply(force(9.9 * std::cos(angle), 9.9 * std::sin(angle), 0.0), 1.0, kTick_s);
  CHECK(out.causes == kNotLimited);
  CHECK(out.F.force_N.y() == Approx(9.9 * std::sin(angle)).epsilon(1e-14));
}

TEST_CASE("no time, or time that runs backwards: nothing grows", "[limits]") {
  for (const double dt_s : {0.0, -0.0, -1e-3, -1e300}) {
    WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
    CHECK(limits.apply(force(5.0, 0.0, 0.0), 1.0, dt_s).F.force_N.norm() == 0.0);
    limits.apply(force(5.0, 0.0, 0.0), 1.0, kTick_s);
    CHECK(limits.apply(force(5.0, 0.0, 0.0), 1.0, dt_s).F.force_N.x() == Approx(2.0));
  }
}

TEST_CASE("after a reset the next wrench grows from zero", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), 10.0, 1.0);
  limits.apply(force(8.0, 0.0, 0.0), 1.0, 1.0);
  limits.reset();
  CHECK(limits.apply(force(8.0, 0.0, 0.0), 1.0, kTick_s).F.force_N.x() == Approx(2.0));
}

TEST_CASE("a million ticks of anything: always finite, within the limits, and by the rule of growth",
          "[limits]") {
  RandomValues random(5);
  LimitSettings settings;
  WrenchLimits limits(settings, 12.0, 0.6);
  Wrench last;
  for (int tick = 0; tick < 1'000'000; ++tick) {
    if (tick % 1'000 == 0) {  // another device, from a state of its own
      settings.force_slew_N_per_s = random.decades(1.0, 1e6);
      settings.torque_slew_Nm_per_s = random.decades(0.1, 1e4);
      limits = WrenchLimits(settings, random.decades(0.1, 100.0), random.decades(0.01, 10.0));
      last = Wrench{};
    }
    Wrench asked{anything3(random), anything3(random)};
    if (random.chance(0.3)) asked.force_N = last.force_N * random.uniform(-2.0, 2.0);  // along what is there
    double authority = random.chance(0.5) ? 1.0 : random.uniform(-0.5, 1.5);
    double dt_s = random.chance(0.1) ? random.uniform(-1.0, 0.0) : random.decades(1e-9, 1.0);
    if (random.chance(0.01)) dt_s = random.chance(0.5) ? 0.0 : kMost;
    bool finite = true;
    if (random.chance(0.002)) {
      const double bad = kNotFiniteValues[static_cast<std::size_t>(random.integer(0, 7))];
      const int slot = random.integer(0, 7);
      (slot < 3    ? asked.force_N[slot]
       : slot < 6  ? asked.torque_Nm[slot - 3]
       : slot == 6 ? authority
                   : dt_s) = bad;
      finite = false;
    }
    const Limited out = limits.apply(asked, authority, dt_s);
    std::string broken;
    if (finite) {
      broken = broken_promise(last.force_N, asked.force_N, out.F.force_N, limits.max_force_N(),
                              settings.force_slew_N_per_s, authority, dt_s);
      if (broken.empty())
        broken = broken_promise(last.torque_Nm, asked.torque_Nm, out.F.torque_Nm, limits.max_torque_Nm(),
                                settings.torque_slew_Nm_per_s, authority, dt_s);
      if ((out.causes & kNotFinite) != 0) broken = "finite input is not called infinite";
    } else if (out.causes != kNotFinite || !out.F.force_N.isZero(0.0) || !out.F.torque_Nm.isZero(0.0)) {
      broken = "zero where the input is not finite";
    }
    if (!broken.empty()) {
      INFO("tick " << tick << ", dt " << dt_s << " s, authority " << authority);
      INFO("last " << last.force_N.transpose() << " | " << last.torque_Nm.transpose());
      INFO("asked " << asked.force_N.transpose() << " | " << asked.torque_Nm.transpose());
      INFO("out " << out.F.force_N.transpose() << " | " << out.F.torque_Nm.transpose());
      FAIL("broken: " << broken);
    }
    last = out.F;
  }
}
