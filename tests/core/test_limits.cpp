// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/device_profile.hpp"
#include "core/limits.hpp"
#include "tests/support/limit_cases.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_limits {

using test::RandomValues;

namespace {

constexpr double kTick_s = 1e-3;
constexpr double kMost = std::numeric_limits<double>::max();
constexpr double kLeast = std::numeric_limits<double>::denorm_min();

/// Limits that are wide except for the tested one.
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

/// Returns a profile with these maxima and no other limit.
DeviceProfile device(double max_force_N, double max_torque_Nm) {
  DeviceProfile profile;
  profile.max_force_N = max_force_N;
  profile.max_torque_Nm = max_torque_Nm;
  return profile;
}

/// Returns the input of a handle at rest in the centre of the workspace.
LimitInput input(const Wrench& asked, double authority = 1.0, double dt_s = kTick_s) {
  return {asked, authority, dt_s, Twist{}, Vector3d::Zero()};
}

Wrench force(double x, double y, double z) {
  return {{x, y, z}, Vector3d::Zero()};
}
Wrench torque(double x, double y, double z) {
  return {Vector3d::Zero(), {x, y, z}};
}

/// Returns the cosine of the angle between two vectors of any finite length.
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
    std::bit_cast<double>(std::uint64_t{0x7fff'ffff'ffff'ffff}),  // full payload
    std::bit_cast<double>(std::uint64_t{0xffff'ffff'ffff'ffff}),
};

}  // namespace

TEST_CASE("a wrench within all limits stays unchanged, bit for bit", "[limits]") {
  RandomValues random(1);
  WrenchLimits limits(without_slew(), device(10.0, 1.0));
  for (int i = 0; i < 10'000; ++i) {
    const Wrench asked{random.uniform(0.0, 9.99) * random.unit<3>(),
                       random.uniform(0.0, 0.999) * random.unit<3>()};
    const Limited out = limits.apply(input(asked));
    REQUIRE(out.causes == kNotLimited);
    REQUIRE(out.F.force_N == asked.force_N);
    REQUIRE(out.F.torque_Nm == asked.torque_Nm);
  }
}

TEST_CASE("NaN or infinity in any component: the output is zero, with the cause", "[limits]") {
  for (const double bad : kNotFiniteValues)
    for (int slot = 0; slot < 6; ++slot) {
      WrenchLimits limits(slew(1.0, 1.0), device(10.0, 1.0));
      limits.set_last_sent(force(5.0, 0.0, 0.0));
      Wrench asked{{1.0, 2.0, 3.0}, {0.1, 0.2, 0.3}};
      (slot < 3 ? asked.force_N[slot] : asked.torque_Nm[slot - 3]) = bad;
      const Limited out = limits.apply(input(asked));
      INFO("slot " << slot);
      REQUIRE(out.F.force_N == Vector3d::Zero());
      REQUIRE(out.F.torque_Nm == Vector3d::Zero());
      REQUIRE(out.causes == kNotFinite);
      // The next wrench grows from zero.
      const Limited after = limits.apply(input(force(5.0, 0.0, 0.0)));
      REQUIRE(after.F.force_N.norm() == Approx(kTick_s));
      REQUIRE(after.causes == kForceSlew);
    }
}

TEST_CASE("a twist or position that is not finite: the output is zero", "[limits]") {
  for (const double bad : kNotFiniteValues)
    for (int slot = 0; slot < 9; ++slot) {
      WrenchLimits limits(without_slew(), device(10.0, 1.0));
      LimitInput in = input(force(5.0, 0.0, 0.0));
      (slot < 3   ? in.V_BH.linear_m_per_s[slot]
       : slot < 6 ? in.V_BH.angular_rad_per_s[slot - 3]
                  : in.p_BH_m[slot - 6]) = bad;
      const Limited out = limits.apply(in);
      INFO("slot " << slot);
      REQUIRE(out.F.force_N == Vector3d::Zero());
      REQUIRE(out.causes == kNotFinite);
    }
}

TEST_CASE("an authority or time step that is not a number: the output is zero", "[limits]") {
  for (const double bad : kNotFiniteValues) {
    WrenchLimits limits(without_slew(), device(10.0, 1.0));
    limits.apply(input(force(5.0, 0.0, 0.0)));
    const Limited by_authority = limits.apply(input(force(5.0, 0.0, 0.0), bad));
    CHECK(by_authority.causes == kNotFinite);
    CHECK(by_authority.F.force_N == Vector3d::Zero());
    const Limited by_time = limits.apply(input(force(5.0, 0.0, 0.0), 1.0, bad));
    CHECK(by_time.causes == kNotFinite);
    CHECK(by_time.F.force_N == Vector3d::Zero());
  }
}

TEST_CASE("a force or torque above its maximum is clamped and keeps its direction", "[limits]") {
  RandomValues random(2);
  WrenchLimits limits(without_slew(), device(10.0, 1.0));
  for (int i = 0; i < 20'000; ++i) {
    limits.reset();
    const Wrench asked{random.log_uniform(10.01, 1e300) * random.unit<3>(),
                       random.log_uniform(1.01, 1e300) * random.unit<3>()};
    const Limited out = limits.apply(input(asked));
    REQUIRE(out.causes == (kForceMagnitude | kTorqueMagnitude));
    REQUIRE(out.F.force_N.norm() <= 10.0);
    REQUIRE(out.F.torque_Nm.norm() <= 1.0);
    REQUIRE(out.F.force_N.norm() == Approx(10.0).epsilon(1e-12));
    REQUIRE(out.F.torque_Nm.norm() == Approx(1.0).epsilon(1e-12));
    REQUIRE(cosine(out.F.force_N, asked.force_N) >= 1.0 - 1e-12);
    REQUIRE(cosine(out.F.torque_Nm, asked.torque_Nm) >= 1.0 - 1e-12);
  }
}

TEST_CASE("vectors of the largest finite length keep their direction", "[limits]") {
  for (const double most : {kMost, 0.5 * kMost, 1e308, 1e200, 1e155, 1e154})
    for (const Vector3d& sign :
         {Vector3d(1, 1, 1), Vector3d(-1, 1, 0), Vector3d(0, 0, -1), Vector3d(0.5, -1, 0.25)}) {
      WrenchLimits limits(without_slew(), device(10.0, 1e-3));
      const Wrench asked{most * sign, -most * sign};
      const Limited out = limits.apply(input(asked));
      INFO(asked.force_N.transpose());
      CHECK(out.F.force_N.norm() == Approx(10.0).epsilon(1e-12));
      CHECK(out.F.torque_Nm.norm() == Approx(1e-3).epsilon(1e-12));
      CHECK(cosine(out.F.force_N, asked.force_N) >= 1.0 - 1e-12);
      CHECK(cosine(out.F.torque_Nm, asked.torque_Nm) >= 1.0 - 1e-12);
    }
}

TEST_CASE("force and torque are limited separately", "[limits]") {
  RandomValues random(3);
  WrenchLimits limits(without_slew(), device(10.0, 1.0));
  for (int i = 0; i < 1'000; ++i) {
    const Vector3d small_force = random.uniform(0.0, 9.99) * random.unit<3>();
    const Vector3d small_torque = random.uniform(0.0, 0.999) * random.unit<3>();
    const Limited long_force = limits.apply(input({1e3 * random.unit<3>(), small_torque}));
    REQUIRE(long_force.causes == kForceMagnitude);
    REQUIRE(long_force.F.torque_Nm == small_torque);
    const Limited long_torque = limits.apply(input({small_force, 1e3 * random.unit<3>()}));
    REQUIRE(long_torque.causes == kTorqueMagnitude);
    REQUIRE(long_torque.F.force_N == small_force);
  }
}

TEST_CASE("settings can tighten the limits of the profile, but not loosen them", "[limits]") {
  const auto limits_with = [](double force_N, double torque_Nm) {
    LimitSettings s = without_slew();
    s.max_force_N = force_N;
    s.max_torque_Nm = torque_Nm;
    return WrenchLimits(s, device(10.0, 1.0));
  };
  CHECK(limits_with(0.0, 0.0).max_force_N() == 10.0);  // 0: the limit of the profile
  CHECK(limits_with(0.0, 0.0).max_torque_Nm() == 1.0);
  CHECK(limits_with(4.0, 0.3).max_force_N() == 4.0);
  CHECK(limits_with(4.0, 0.3).max_torque_Nm() == 0.3);
  for (const double loose : {11.0, 1e9, kMost, std::numeric_limits<double>::infinity(), -5.0,
                             std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(limits_with(loose, loose).max_force_N() == 10.0);
    CHECK(limits_with(loose, loose).max_torque_Nm() == 1.0);
    WrenchLimits limits = limits_with(loose, loose);
    CHECK(limits.apply(input(force(100.0, 0.0, 0.0))).F.force_N.norm() <= 10.0);
  }
  WrenchLimits tight = limits_with(4.0, 0.3);
  CHECK(tight.apply(input(force(100.0, 0.0, 0.0))).F.force_N.norm() <= 4.0);
  CHECK(tight.apply(input(torque(100.0, 0.0, 0.0))).F.torque_Nm.norm() <= 0.3);
}

TEST_CASE("authority scales the wrench after the magnitude limit", "[limits]") {
  WrenchLimits limits(without_slew(), device(10.0, 1.0));
  const Limited half = limits.apply(input(force(100.0, 0.0, 0.0), 0.5));
  CHECK(half.F.force_N.x() == Approx(5.0));
  CHECK(half.causes == (kForceMagnitude | kAuthority));
  const Limited none = limits.apply(input(force(3.0, 4.0, 0.0), 0.0));
  CHECK(none.F.force_N == Vector3d::Zero());
  CHECK(none.causes == kAuthority);
  CHECK(limits.apply(input(force(3.0, 4.0, 0.0), -7.0)).F.force_N == Vector3d::Zero());
  const Limited more =
      limits.apply(input(force(3.0, 4.0, 0.0), 7.0));  // never more than the requested wrench
  CHECK(more.F.force_N == Vector3d(3.0, 4.0, 0.0));
  CHECK(more.causes == kNotLimited);
}

TEST_CASE("a force grows at most at its slew rate and reaches its value", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  for (int tick = 1; tick < 5; ++tick) {
    const Limited out = limits.apply(input(force(0.0, 10.0, 0.0)));
    REQUIRE(out.F.force_N.y() == Approx(2.0 * tick).epsilon(1e-14));
    REQUIRE(out.causes == kForceSlew);
  }
  limits.apply(input(force(0.0, 10.0, 0.0)));
  const Limited arrived = limits.apply(input(force(0.0, 10.0, 0.0)));
  CHECK(arrived.F.force_N.y() == Approx(10.0).epsilon(1e-14));
  CHECK(arrived.causes == kNotLimited);
}

TEST_CASE("a torque has its own slew rate", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  const Limited out = limits.apply(input({{1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}));
  CHECK(out.F.force_N == Vector3d(1.0, 0.0, 0.0));
  CHECK(out.F.torque_Nm.z() == Approx(0.05).epsilon(1e-14));
  CHECK(out.causes == kTorqueSlew);
}

TEST_CASE("force may decrease at any rate", "[limits]") {
  RandomValues random(4);
  for (int i = 0; i < 1'000; ++i) {
    WrenchLimits limits(slew(1.0, 1.0), device(10.0, 1.0));
    const Wrench full{9.0 * random.unit<3>(), 0.9 * random.unit<3>()};
    limits.set_last_sent(full);
    const double share = i % 3 == 0 ? 0.0 : random.uniform(0.0, 1.0);
    const Wrench less{share * full.force_N, share * full.torque_Nm};
    const Limited out = limits.apply(input(less, 1.0, 0.0));  // time step 0
    REQUIRE((out.F.force_N - less.force_N).norm() <= 1e-14);
    REQUIRE((out.F.torque_Nm - less.torque_Nm).norm() <= 1e-14);
  }
}

TEST_CASE("authority may fall at any rate; a rise is limited by the slew rate", "[limits]") {
  WrenchLimits limits(slew(1.0, 1.0), device(10.0, 1.0));
  limits.set_last_sent(force(9.0, 0.0, 0.0));
  CHECK(limits.apply(input(force(9.0, 0.0, 0.0), 0.0)).F.force_N.norm() == 0.0);
  CHECK(limits.apply(input(force(9.0, 0.0, 0.0))).F.force_N.norm() == Approx(1e-3));
}

TEST_CASE("on a reversal the old force ends immediately and the new force grows from zero", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  limits.apply(input(force(8.0, 0.0, 0.0), 1.0, 1.0));
  for (int tick = 1; tick < 4; ++tick) {
    const Limited out = limits.apply(input(force(-8.0, 0.0, 0.0)));
    REQUIRE(out.F.force_N.x() == Approx(-2.0 * tick).epsilon(1e-13));
    REQUIRE(out.causes == kForceSlew);
  }
}

TEST_CASE("a rotating force keeps its component along the previous force", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  limits.apply(input(force(8.0, 0.0, 0.0), 1.0, 1.0));
  const Limited out = limits.apply(input(force(3.0, 7.0, 0.0)));  // 3 N along the previous force, 2 N across
  CHECK(out.F.force_N.x() == Approx(3.0).epsilon(1e-14));
  CHECK(out.F.force_N.y() == Approx(2.0).epsilon(1e-14));
}

TEST_CASE("a small rotation of the maximum force passes unchanged", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  limits.apply(input(force(9.9, 0.0, 0.0), 1.0, 1.0));
  const double angle = 0.1;  // 1 N across; the slew rate allows 2 N
  const Limited out = limits.apply(input(force(9.9 * std::cos(angle), 9.9 * std::sin(angle), 0.0)));
  CHECK(out.causes == kNotLimited);
  CHECK(out.F.force_N.y() == Approx(9.9 * std::sin(angle)).epsilon(1e-14));
}

TEST_CASE("with a time step of zero or less no force grows", "[limits]") {
  for (const double dt_s : {0.0, -0.0, -1e-3, -1e300}) {
    WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
    CHECK(limits.apply(input(force(5.0, 0.0, 0.0), 1.0, dt_s)).F.force_N.norm() == 0.0);
    limits.apply(input(force(5.0, 0.0, 0.0)));
    CHECK(limits.apply(input(force(5.0, 0.0, 0.0), 1.0, dt_s)).F.force_N.x() == Approx(2.0));
  }
}

TEST_CASE("after a reset the next wrench grows from zero", "[limits]") {
  WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
  limits.apply(input(force(8.0, 0.0, 0.0), 1.0, 1.0));
  limits.reset();
  CHECK(limits.apply(input(force(8.0, 0.0, 0.0))).F.force_N.x() == Approx(2.0));
}

// A known error of rate limiters: at or above the limit they compute the root of a negative number. A
// comparison with the resulting NaN is false, so nothing is limited.
TEST_CASE("a previous wrench above the limit does not raise the limit", "[limits]") {
  RandomValues random(6);
  for (const double before : {10.0, 10.0 * (1.0 + 1e-15), 10.1, 12.0, 40.0, 1e6, 1e160, kMost}) {
    const Vector3d direction = random.unit<3>();
    for (const Vector3d& way : {direction, Vector3d(-direction), Vector3d(random.unit<3>())}) {
      WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
      limits.set_last_sent({before * direction, before * direction});
      for (int tick = 0; tick < 20; ++tick) {
        const Limited out = limits.apply(input({1e3 * way, 1e3 * way}));
        INFO("before " << before << " N, tick " << tick);
        REQUIRE(out.F.force_N.norm() <= 10.0);
        REQUIRE(out.F.torque_Nm.norm() <= 1.0);
      }
    }
  }
}

TEST_CASE("after a previous wrench that is not finite the next one grows from zero", "[limits]") {
  for (const double bad : kNotFiniteValues) {
    WrenchLimits limits(slew(2000.0, 50.0), device(10.0, 1.0));
    limits.set_last_sent({{bad, 1.0, 1.0}, {1.0, bad, 1.0}});
    const Limited out = limits.apply(input({{9.0, 0.0, 0.0}, {0.9, 0.0, 0.0}}));
    CHECK(out.F.force_N.norm() == Approx(2.0));
    CHECK(out.F.torque_Nm.norm() == Approx(0.05));
  }
}

TEST_CASE("a long time step does not permit a larger growth", "[limits]") {
  for (const double dt_s : {kMaxStep_s, 0.02, 1.0, 3600.0, kMost}) {
    WrenchLimits limits(slew(500.0, 50.0), device(10.0, 1.0));
    CHECK(limits.apply(input(force(9.0, 0.0, 0.0), 1.0, dt_s)).F.force_N.norm() == Approx(5.0));
  }
}

TEST_CASE("limits that are not stated permit no force", "[limits]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double none : {nan, -1.0, 0.0, std::numeric_limits<double>::infinity()}) {
    WrenchLimits silent(without_slew(), device(none, none));
    const Limited out = silent.apply(input({{5.0, 0.0, 0.0}, {0.5, 0.0, 0.0}}));
    CHECK(out.F.force_N == Vector3d::Zero());
    CHECK(out.F.torque_Nm == Vector3d::Zero());
    CHECK(out.causes == (kForceMagnitude | kTorqueMagnitude));
  }
  for (const double none : {nan, -1.0, std::numeric_limits<double>::infinity()}) {
    WrenchLimits still(slew(none, none), device(10.0, 1.0));
    CHECK(still.apply(input(force(5.0, 0.0, 0.0))).F.force_N == Vector3d::Zero());
  }
  const WrenchLimits any(without_slew(), device(1e9, 1e9));
  CHECK(any.max_force_N() == kAbsoluteMaxForce_N);
  CHECK(any.max_torque_Nm() == kAbsoluteMaxTorque_Nm);
}

TEST_CASE("the thermal limits clamp force and torque separately and never raise the maximum", "[limits]") {
  WrenchLimits limits(without_slew(), device(10.0, 1.0));
  limits.set_ceiling(4.0, 1.0);
  const Limited warm = limits.apply(input({{0.0, 100.0, 0.0}, {0.0, 0.5, 0.0}}));
  CHECK(warm.F.force_N.y() == Approx(4.0).epsilon(1e-14));
  CHECK(warm.F.torque_Nm.y() == 0.5);
  CHECK(warm.causes == (kForceMagnitude | kForceThermal));
  CHECK(limits.apply(input(force(5.0, 0.0, 0.0))).causes == kForceThermal);
  CHECK(limits.apply(input(force(3.0, 0.0, 0.0))).causes == kNotLimited);
  limits.set_ceiling(10.0, 0.2);
  const Limited turned = limits.apply(input({{0.0, 5.0, 0.0}, {0.0, 0.5, 0.0}}));
  CHECK(turned.F.force_N.y() == 5.0);
  CHECK(turned.F.torque_Nm.y() == Approx(0.2).epsilon(1e-14));
  CHECK(turned.causes == kTorqueThermal);
  limits.set_ceiling(1e6, kMost);
  const Limited high = limits.apply(input({{1e3, 0.0, 0.0}, {1e3, 0.0, 0.0}}));
  CHECK(high.F.force_N.norm() <= 10.0);
  CHECK(high.F.torque_Nm.norm() <= 1.0);
  for (const double bad : kNotFiniteValues) {
    limits.set_ceiling(bad, bad);
    CHECK(limits.apply(input({{5.0, 0.0, 0.0}, {0.5, 0.0, 0.0}})).F.force_N == Vector3d::Zero());
  }
  limits.set_ceiling(-3.0, -3.0);
  CHECK(limits.apply(input(force(5.0, 0.0, 0.0))).F.force_N == Vector3d::Zero());
}

TEST_CASE("outside of the workspace the wrench decreases linearly, to zero at 1.1 times the radius",
          "[limits]") {
  DeviceProfile profile = device(10.0, 1.0);
  profile.workspace_radius_m = 0.2;
  profile.workspace_centre_m = {0.1, -0.1, 0.3};
  WrenchLimits limits(without_slew(), profile);
  RandomValues random(7);
  const auto at = [&](double radii) {
    LimitInput in = input({{3.0, 4.0, 0.0}, {0.0, 0.3, 0.4}});
    in.p_BH_m = profile.workspace_centre_m + radii * 0.2 * random.unit<3>();
    return limits.apply(in);
  };
  for (const double inside : {0.0, 0.5, 0.999}) {
    CHECK(at(inside).F.force_N == Vector3d(3.0, 4.0, 0.0));
    CHECK(at(inside).causes == kNotLimited);
  }
  for (const double share : {0.9, 0.5, 0.25, 0.01}) {
    const Limited out = at(1.1 - 0.1 * share);
    CHECK(out.F.force_N.norm() == Approx(5.0 * share).epsilon(1e-9));
    CHECK(out.F.torque_Nm.norm() == Approx(0.5 * share).epsilon(1e-9));
    CHECK(out.causes == kWorkspaceEdge);
  }
  for (const double outside : {1.1001, 2.0, 1e9, 1e300}) {
    CHECK(at(outside).F.force_N == Vector3d::Zero());
    CHECK(at(outside).F.torque_Nm == Vector3d::Zero());
    CHECK(at(outside).causes == kWorkspaceEdge);
  }
  WrenchLimits endless(without_slew(), device(10.0, 1.0));
  LimitInput far = input(force(5.0, 0.0, 0.0));
  far.p_BH_m = {1e6, 0.0, 0.0};
  CHECK(endless.apply(far).causes == kNotLimited);
}

TEST_CASE("power into the hand is limited by one common factor; braking is not limited", "[limits]") {
  DeviceProfile profile = device(10.0, 1.0);
  profile.max_power_W = 2.0;
  WrenchLimits limits(without_slew(), profile);
  const auto moving = [&](const Vector3d& linear, const Vector3d& angular) {
    LimitInput in = input({{5.0, 0.0, 0.0}, {0.0, 0.5, 0.0}});
    in.V_BH = {linear, angular};
    return limits.apply(in);
  };
  const Limited pushed = moving({0.6, 0.0, 0.0}, {0.0, 2.0, 0.0});  // 3 W and 1 W
  CHECK(pushed.F.force_N.x() == Approx(2.5).epsilon(1e-12));
  CHECK(pushed.F.torque_Nm.y() == Approx(0.25).epsilon(1e-12));
  CHECK(pushed.causes == kPower);
  CHECK(moving({0.19, 5.0, 0.0}, {0.0, 2.0, 0.0}).causes == kNotLimited);   // 0.95 W and 1 W
  CHECK(moving({-5.0, 0.0, 0.0}, {0.0, 0.0, 0.0}).causes == kNotLimited);   // brakes with 25 W
  CHECK(moving({0.6, 0.0, 0.0}, {0.0, -2.01, 0.0}).causes == kNotLimited);  // less than 2 W in total
  CHECK(moving({1e308, 0.0, 0.0}, {0.0, -1e308, 0.0}).F.force_N.norm() < 1e-300);
  // The slew limit reduces the braking torque: the force alone would have 3 W.
  WrenchLimits slow(slew(2000.0, 0.1), profile);
  slow.set_last_sent(force(5.0, 0.0, 0.0));
  LimitInput in = input({{5.0, 0.0, 0.0}, {0.0, 0.5, 0.0}});
  in.V_BH = {{0.6, 0.0, 0.0}, {0.0, -4.0, 0.0}};
  const Limited held = slow.apply(in);
  CHECK(held.causes == (kTorqueSlew | kPower));
  CHECK(held.F.force_N.dot(in.V_BH.linear_m_per_s) + held.F.torque_Nm.dot(in.V_BH.angular_rad_per_s) <= 2.0);
  WrenchLimits any(without_slew(), device(10.0, 1.0));
  in.V_BH.linear_m_per_s.x() = 1e6;
  CHECK(any.apply(in).causes == kNotLimited);
}

TEST_CASE("each limit cause has a name", "[limits]") {
  std::set<std::string> names;
  for (unsigned bit = 1; bit <= kPower; bit *= 2) names.insert(text(static_cast<LimitCause>(bit)));
  CHECK(names.size() == 10);
  CHECK(names.count("unknown") == 0);
  CHECK(text(static_cast<LimitCause>(0x8000)) == std::string("unknown"));
}

TEST_CASE("a million random ticks satisfy every invariant of the oracle", "[limits]") {
  constexpr std::uint64_t kSeed = 20'251'122;
  constexpr int kCases = 1'000'000;
  test::LimitCases cases(kSeed);
  std::array<int, 16> seen{};
  int untouched = 0;
  for (int i = 0; i < kCases; ++i) {
    const std::string broken = cases.next();
    if (!broken.empty()) FAIL("seed " << kSeed << ": " << broken << "\n" << cases.describe());
    for (unsigned bit = 0; bit < 16; ++bit) seen[bit] += cases.out().causes >> bit & 1;
    untouched += cases.out().causes == kNotLimited ? 1 : 0;
  }
  // Every limit must have acted, otherwise the test covers too little.
  for (unsigned bit = 0; bit < 10; ++bit) {
    INFO(text(static_cast<LimitCause>(1u << bit)) << " in " << seen[bit] << " cases");
    CHECK(seen[bit] > kCases / 100);
  }
  INFO(untouched << " cases went out as they came");
  CHECK(untouched > kCases / 100);
}

}  // namespace wrenchd::test_limits
