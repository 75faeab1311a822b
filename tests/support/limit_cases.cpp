// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/limit_cases.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <sstream>

#include "core/finite.hpp"

namespace wrenchd::test {
namespace {

constexpr double kMost = std::numeric_limits<double>::max();
constexpr double kDenormal = std::numeric_limits<double>::denorm_min();
constexpr std::uint64_t kTicksEach = 64;  ///< number of ticks per device

}  // namespace

LimitCases::LimitCases(std::uint64_t seed) : state_(seed), limits_({}, profile_) {}

/// splitmix64 (Steele, Lea, Flood 2014). Its cost is small compared with the code under test.
std::uint64_t LimitCases::bits() noexcept {
  std::uint64_t z = state_ += 0x9e37'79b9'7f4a'7c15;
  z = (z ^ (z >> 30)) * 0xbf58'476d'1ce4'e5b9;
  z = (z ^ (z >> 27)) * 0x94d0'49bb'1331'11eb;
  return z ^ (z >> 31);
}

double LimitCases::uniform01() noexcept {
  return static_cast<double>(bits() >> 11) * 0x1p-53;
}

double LimitCases::power_of_two(int from, int to) noexcept {
  return std::ldexp(1.0 + uniform01(), from + static_cast<int>(uniform01() * (to - from)));
}

/// Returns a finite number of any magnitude.
double LimitCases::any_double() noexcept {
  const double sign = chance(0.5) ? 1.0 : -1.0;
  switch (bits() % 6) {
    case 0:
      return sign * 0.0;
    case 1:
      return sign * kDenormal * static_cast<double>(bits() % 9);
    case 2:
      return sign * power_of_two(-1074, -1000);
    case 3:
      return sign * power_of_two(300, 1023);
    case 4:
      return sign * kMost;
    default:
      return sign * power_of_two(-60, 60);
  }
}

/// Returns an infinity of either sign, or a NaN of any sign and payload.
double LimitCases::not_finite() noexcept {
  constexpr std::uint64_t kSign = 0x8000'0000'0000'0000, kExponent = 0x7ff0'0000'0000'0000;
  return std::bit_cast<double>(kExponent | (chance(0.5) ? bits() : bits() & kSign));
}

double LimitCases::adjacent_double(double x) noexcept {
  switch (bits() % 3) {
    case 0:
      return x;
    case 1:
      return std::nextafter(x, kMost);
    default:
      return std::nextafter(x, -kMost);
  }
}

Vector3d LimitCases::direction() noexcept {
  if (chance(0.2)) return Vector3d::Unit(static_cast<Eigen::Index>(bits() % 3)) * (chance(0.5) ? 1.0 : -1.0);
  Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
  return v.norm() > 1e-3 ? v.normalized() : Vector3d(Vector3d::UnitX());
}

Vector3d LimitCases::requested_vector(double limit, const Vector3d& last) noexcept {
  const bool known = is_finite(last);
  switch (bits() % 10) {
    case 0:
      return Vector3d::Zero();
    case 1:
      return adjacent_double(limit) * direction();
    case 2:
      return power_of_two(-3, 900) * direction();
    case 3:
      return {any_double(), any_double(), any_double()};
    case 4:
      return Vector3d::Constant(any_double());
    case 5:
      if (known) return between(-2, 2) * 0.25 * last;
      break;
    case 6:
      if (known) return chance(0.5) ? last : Vector3d(-last);
      break;
    case 7:
      if (known) return 0.5 * last + 0.01 * limit * direction();
      break;
    default:
      break;
  }
  return between(0, 1.5) * limit * direction();
}

/// Returns an arbitrary previous wrench, which need not respect the limits.
Vector3d LimitCases::previous_vector(double limit) noexcept {
  switch (bits() % 6) {
    case 0:
      return {any_double(), any_double(), any_double()};
    case 1:
      return adjacent_double(limit) * direction();
    case 2:
      return between(1, 10) * limit * direction();
    case 3: {
      Vector3d v = limit * direction();
      v[static_cast<Eigen::Index>(bits() % 3)] = not_finite();
      return v;
    }
    case 4:
      return Vector3d::Zero();
    default:
      return between(0, 1) * limit * direction();
  }
}

Vector3d LimitCases::position() noexcept {
  const double radius = guarantees_.workspace_radius_m > 0 ? guarantees_.workspace_radius_m : 0.2;
  switch (bits() % 8) {
    case 0:
      return guarantees_.workspace_centre_m + adjacent_double(radius) * direction();
    case 1:
      return guarantees_.workspace_centre_m + adjacent_double(1.1 * radius) * direction();
    case 2:
    case 3:
      return guarantees_.workspace_centre_m + between(1, 1.1) * radius * direction();
    case 4:
      return chance(0.9) ? Vector3d(guarantees_.workspace_centre_m + between(1, 3) * radius * direction())
                         : Vector3d(any_double(), any_double(), any_double());
    default:
      return guarantees_.workspace_centre_m + between(0, 1) * radius * direction();
  }
}

Twist LimitCases::motion() noexcept {
  const Wrench& F = input_.requested;
  const double f = F.force_N.cwiseAbs().maxCoeff(), tau = F.torque_Nm.cwiseAbs().maxCoeff();
  const double speed = power_of_two(-8, 4), spin = power_of_two(-5, 7);
  Twist V{speed * direction(), spin * direction()};
  switch (bits() % 8) {
    case 0:
      return {};
    case 1:  // both push
      if (f > 0 && tau > 0) V = {F.force_N / f * speed, F.torque_Nm / tau * spin};
      return V;
    case 2:  // one pushes, the other brakes
      if (f > 0 && tau > 0) V = {F.force_N / f * speed, -F.torque_Nm / tau * spin};
      return V;
    case 3:  // both brake
      if (f > 0 && tau > 0) V = {-F.force_N / f * speed, -F.torque_Nm / tau * spin};
      return V;
    case 4:
      return {{any_double(), any_double(), any_double()}, {any_double(), any_double(), any_double()}};
    case 5:
      V.linear_m_per_s *= power_of_two(0, 40);
      return V;
    default:
      return V;
  }
}

double LimitCases::authority() noexcept {
  switch (bits() % 10) {
    case 0:
      return chance(0.5) ? 0.0 : -0.0;
    case 1:
      return any_double();
    case 2:
      return adjacent_double(1.0);
    case 3:
    case 4:
      return between(-0.2, 1.2);
    default:
      return 1.0;
  }
}

double LimitCases::step_s() noexcept {
  switch (bits() % 10) {
    case 0:
      return chance(0.5) ? 0.0 : -0.0;
    case 1:
      return any_double();
    case 2:
      return -between(0, 1);
    case 3:
      return adjacent_double(kMaxStep_s);
    case 4:
      return power_of_two(-30, 4);
    default:
      return 1e-3;
  }
}

double LimitCases::ceiling(double maximum) noexcept {
  switch (bits() % 6) {
    case 0:
      return between(0, 1) * maximum;
    case 1:
      return adjacent_double(maximum);
    case 2:
      return chance(0.5) ? 0.0 : any_double();
    default:
      return maximum;
  }
}

void LimitCases::randomize_device() {
  LimitSettings settings;
  settings.force_slew_N_per_s = power_of_two(0, 20);
  settings.torque_slew_Nm_per_s = power_of_two(-4, 14);
  profile_.max_force_N = power_of_two(-3, 6);
  profile_.max_torque_Nm = power_of_two(-6, 3);
  const bool edge = chance(0.7), power = chance(0.7);
  profile_.workspace_radius_m = edge ? power_of_two(-6, 0) : DeviceProfile::kNotStated;
  profile_.workspace_centre_m =
      chance(0.5) ? Vector3d(Vector3d::Zero()) : Vector3d(between(0, 1) * direction());
  profile_.max_power_W = power ? power_of_two(-6, 8) : DeviceProfile::kNotStated;
  limits_ = WrenchLimits(settings, profile_);
  guarantees_ = {profile_.max_force_N,
                 profile_.max_torque_Nm,
                 profile_.max_force_N,
                 profile_.max_torque_Nm,
                 settings.force_slew_N_per_s,
                 settings.torque_slew_Nm_per_s,
                 edge ? profile_.workspace_radius_m : 0.0,
                 profile_.workspace_centre_m,
                 power ? profile_.max_power_W : 0.0};
  last_ = Wrench{};
}

/// Replaces one number of the input by one that is not finite.
void LimitCases::corrupt() noexcept {
  const double bad = not_finite();
  const auto axis = static_cast<Eigen::Index>(bits() % 3);
  switch (bits() % 7) {
    case 0:
      input_.requested.force_N[axis] = bad;
      break;
    case 1:
      input_.requested.torque_Nm[axis] = bad;
      break;
    case 2:
      input_.V_BH.linear_m_per_s[axis] = bad;
      break;
    case 3:
      input_.V_BH.angular_rad_per_s[axis] = bad;
      break;
    case 4:
      input_.p_BH_m[axis] = bad;
      break;
    case 5:
      input_.authority = bad;
      break;
    default:
      input_.dt_s = bad;
  }
}

std::string LimitCases::next() {
  if (count_++ % kTicksEach == 0) randomize_device();
  if (chance(0.1)) {
    const double force_N = ceiling(guarantees_.max_force_N), torque_Nm = ceiling(guarantees_.max_torque_Nm);
    limits_.set_ceiling(force_N, torque_Nm);
    guarantees_.force_ceiling_N = std::fmin(std::fmax(force_N, 0.0), guarantees_.max_force_N);
    guarantees_.torque_ceiling_Nm = std::fmin(std::fmax(torque_Nm, 0.0), guarantees_.max_torque_Nm);
  }
  if (chance(0.1)) {
    last_ = {previous_vector(guarantees_.max_force_N), previous_vector(guarantees_.max_torque_Nm)};
    limits_.set_last_sent(last_);
  }
  input_.requested = {requested_vector(guarantees_.max_force_N, last_.force_N),
                      requested_vector(guarantees_.max_torque_Nm, last_.torque_Nm)};
  input_.authority = authority();
  input_.dt_s = step_s();
  input_.V_BH = motion();
  input_.p_BH_m = position();
  if (chance(0.02)) corrupt();
  out_ = limits_.apply(input_);
  before_ = last_;
  last_ = out_.F;
  return broken_invariant(guarantees_, before_, input_, out_);
}

std::string LimitCases::describe() const {
  std::ostringstream text;
  text.precision(17);
  const auto show = [&](const char* name, const Vector3d& v) {
    text << name << " " << v[0] << " " << v[1] << " " << v[2] << "\n";
  };
  text << "case " << count_ << ", max " << guarantees_.max_force_N << " N " << guarantees_.max_torque_Nm
       << " N.m, ceiling " << guarantees_.force_ceiling_N << " N " << guarantees_.torque_ceiling_Nm
       << " N.m, slew " << guarantees_.force_slew_N_per_s << " N/s " << guarantees_.torque_slew_Nm_per_s
       << " N.m/s, radius " << guarantees_.workspace_radius_m << " m, power " << guarantees_.max_power_W
       << " W\n";
  text << "authority " << input_.authority << ", dt " << input_.dt_s << " s, causes " << std::hex << "0x"
       << out_.causes << std::dec << "\n";
  show("centre", guarantees_.workspace_centre_m);
  show("place", input_.p_BH_m);
  show("linear", input_.V_BH.linear_m_per_s);
  show("angular", input_.V_BH.angular_rad_per_s);
  show("last force", before_.force_N);
  show("last torque", before_.torque_Nm);
  show("asked force", input_.requested.force_N);
  show("asked torque", input_.requested.torque_Nm);
  show("out force", out_.F.force_N);
  show("out torque", out_.F.torque_Nm);
  return text.str();
}

}  // namespace wrenchd::test
