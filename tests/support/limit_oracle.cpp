// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/limit_oracle.hpp"

#include <cmath>
#include <cstring>

namespace wrenchd::test {
namespace {

using Real = long double;

/// Three numbers without a vector library, so that the oracle shares no code with the limiter.
struct V3 {
  Real x = 0, y = 0, z = 0;
};
V3 v3(const Vector3d& v) {
  return {v[0], v[1], v[2]};
}
V3 operator+(V3 a, V3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
V3 operator-(V3 a, V3 b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
V3 operator*(Real s, V3 a) {
  return {s * a.x, s * a.y, s * a.z};
}
Real dot(V3 a, V3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
Real size(V3 a) {  // the exponent range of a long double holds the square of any double
  return std::sqrt(dot(a, a));
}

/// Tests the exponent in the bytes of a little-endian double, without arithmetic and without the code under
/// test.
bool finite(double x) {
  unsigned char bytes[sizeof x];
  std::memcpy(bytes, &x, sizeof x);
  return !((bytes[7] & 0x7f) == 0x7f && (bytes[6] & 0xf0) == 0xf0);
}
bool finite(const Vector3d& v) {
  return finite(v[0]) && finite(v[1]) && finite(v[2]);
}

/// Returns the segment from the previous wrench to zero, restricted to the part within the limit.
V3 legal(const Vector3d& last, Real limit) {
  if (!finite(last)) return {};
  const V3 v = v3(last);
  const Real length = size(v);
  return length > limit ? (limit / length) * v : v;
}

/// Returns the point nearest to v on the segment from `last` to zero.
V3 nearest(V3 v, V3 last) {
  const Real square = dot(last, last);
  if (!(square > 0)) return {};
  const Real t = dot(v, last) / square;
  return (t < 0 ? 0 : t > 1 ? 1 : t) * last;
}

/// Tolerance relative to the limit. Each operation on doubles rounds by 1.1e-16; the workspace edge subtracts
/// nearly equal distances.
constexpr Real kRounding = 1e-13L;
constexpr Real kDirected = 1e-290L;       // denormal numbers have too few digits for a direction
constexpr Real kSmallestLimit = 1e-320L;  // limits this small are a few of the smallest denormal steps

struct Group {
  const char* name;
  V3 asked, last, out;
  Real maximum, ceiling, growth, share;  ///< share: factor of workspace edge and authority
  bool magnitude_told, ceiling_told, slew_told, scaled_told, power_told;
};

std::string broken(const Group& g) {
  const auto is = [&](const char* what) { return std::string(g.name) + ": " + what; };
  const Real out = size(g.out), asked = size(g.asked);
  const Real slack = kRounding * g.maximum + kSmallestLimit;
  const Real limit = g.maximum < g.ceiling ? g.maximum : g.ceiling;
  if (out > limit * (1 + 1e-15L) + kSmallestLimit) return is("I2 longer than its limit");

  Real most = asked < limit ? asked : limit;
  most *= g.share;
  if (out > most * (1 + kRounding) + slack) return is("I5 more than authority and edge leave");
  if (size(g.out - nearest(g.out, g.last)) > g.growth * (1 + kRounding) + slack)
    return is("I4 grew faster than slew * dt");

  if (out > kDirected) {
    if (!g.slew_told) {
      if (asked == 0 || dot(g.out, g.asked) / (out * asked) < 1 - 1e-12L) return is("I3 direction");
    } else {
      // out = a last + b requested: subtract the part along `requested`; the rest must be parallel to `last`.
      const Real ll = dot(g.last, g.last), la = dot(g.last, g.asked), aa = dot(g.asked, g.asked);
      const Real lo = dot(g.last, g.out), ao = dot(g.asked, g.out);
      const Real det = ll * aa - la * la;
      if (det > 1e-9L * ll * aa) {  // otherwise they are parallel within 3e-5 rad
        const Real a = (lo * aa - ao * la) / det, b = (ao * ll - lo * la) / det;
        if (a * std::sqrt(ll) < -1e-9L * g.maximum || b * std::sqrt(aa) < -1e-9L * g.maximum)
          return is("I3 not between what was and what was asked for");
        if (size(g.out - (a * g.last + b * g.asked)) > 1e-9L * g.maximum)
          return is("I3 out of the plane of what was and what was asked for");
      } else if (aa > 0 && size(g.out - (ao / aa) * g.asked) > 1e-4L * g.maximum) {
        return is("I3 off the line of what was and what was asked for");
      }
    }
  }

  if (g.magnitude_told != (asked > g.maximum) && std::abs(asked - g.maximum) > kRounding * g.maximum)
    return is("I7 magnitude reported without effect, or the reverse");
  const Real long_most = asked < g.maximum ? asked : g.maximum;
  if (g.ceiling_told != (long_most > g.ceiling) && std::abs(long_most - g.ceiling) > kRounding * g.maximum)
    return is("I7 thermal ceiling reported without effect, or the reverse");
  const V3 target = asked > 0 ? (most / asked) * g.asked : V3{};
  const Real wanted = size(target - nearest(target, g.last));
  if (g.slew_told != (wanted > g.growth) && std::abs(wanted - g.growth) > slack)
    return is("I7 slew reported without effect, or the reverse");
  if (!g.power_told) {
    if (!g.slew_told && size(g.out - target) > slack) return is("I7 less than may go out");
    if (g.slew_told && size(g.out - nearest(target, g.last)) < g.growth * (1 - 1e-12L) - slack)
      return is("I7 grew less than slew * dt allows");
  }
  const bool cut = g.magnitude_told || g.ceiling_told || g.slew_told || g.scaled_told || g.power_told;
  if (!cut && (g.out.x != g.asked.x || g.out.y != g.asked.y || g.out.z != g.asked.z))
    return is("I7 changed without a reported cause");
  return {};
}

bool all_finite(const LimitInput& in) {
  return finite(in.requested.force_N) && finite(in.requested.torque_Nm) && finite(in.authority) &&
         finite(in.dt_s) && finite(in.V_BH.linear_m_per_s) && finite(in.V_BH.angular_rad_per_s) &&
         finite(in.p_BH_m);
}

}  // namespace

std::string broken_invariant(const LimitGuarantees& p, const Wrench& last, const LimitInput& in,
                             const Limited& out) {
  const auto reported = [&](unsigned cause) { return (out.causes & cause) != 0; };
  if (!finite(out.F.force_N) || !finite(out.F.torque_Nm)) return "I1 not finite";
  const V3 f = v3(out.F.force_N), tau = v3(out.F.torque_Nm);
  if (!all_finite(in)) {
    if (size(f) != 0 || size(tau) != 0) return "I1 an input that is not finite, and no zero";
    return out.causes == kNotFinite ? "" : "I1 an input that is not finite is not reported";
  }
  if (reported(kNotFinite)) return "I1 a finite input is reported as not finite";

  const Real authority = in.authority < 0 ? 0 : in.authority > 1 ? 1 : in.authority;
  if (authority == 0 && (size(f) != 0 || size(tau) != 0)) return "I5 authority 0, and no zero";
  if (reported(kAuthority) != (authority < 1))
    return "I7 authority reported at full authority, or the reverse";

  Real edge = 1;
  if (p.workspace_radius_m > 0) {
    const Real radii = size(v3(in.p_BH_m) - v3(p.workspace_centre_m)) / p.workspace_radius_m;
    edge = radii <= 1 ? 1 : radii >= 1.1L ? 0 : (1.1L - radii) / 0.1L;
    // Within rounding of 1 radius, or of 1.1 radii, both answers are valid.
    if (reported(kWorkspaceEdge) != (radii > 1) && std::abs(radii - 1) > 1e-12L)
      return "I7 workspace edge reported wrongly";
    if (radii > 1.1L + 1e-12L && (size(f) != 0 || size(tau) != 0)) return "I5 beyond the edge, and no zero";
  } else if (reported(kWorkspaceEdge)) {
    return "I7 there is no workspace edge";
  }

  const Real dt_s = in.dt_s < 0 ? 0 : in.dt_s > 0.010 ? 0.010L : in.dt_s;
  const bool scaled = reported(kAuthority) || reported(kWorkspaceEdge);
  std::string what =
      broken({"force", v3(in.requested.force_N), legal(last.force_N, p.max_force_N), f, p.max_force_N,
              p.force_ceiling_N, p.force_slew_N_per_s * dt_s, edge * authority, reported(kForceMagnitude),
              reported(kForceThermal), reported(kForceSlew), scaled, reported(kPower)});
  if (!what.empty()) return what;
  what = broken({"torque", v3(in.requested.torque_Nm), legal(last.torque_Nm, p.max_torque_Nm), tau,
                 p.max_torque_Nm, p.torque_ceiling_Nm, p.torque_slew_Nm_per_s * dt_s, edge * authority,
                 reported(kTorqueMagnitude), reported(kTorqueThermal), reported(kTorqueSlew), scaled,
                 reported(kPower)});
  if (!what.empty()) return what;

  const V3 v = v3(in.V_BH.linear_m_per_s), w = v3(in.V_BH.angular_rad_per_s);
  const Real power = dot(f, v) + dot(tau, w);
  const auto terms = [](V3 a, V3 b) {
    return std::abs(a.x * b.x) + std::abs(a.y * b.y) + std::abs(a.z * b.z);
  };
  const Real all_terms = terms(f, v) + terms(tau, w);
  if (!(p.max_power_W > 0)) return reported(kPower) ? "I7 power reported without a power limit" : "";
  if (power > p.max_power_W * (1 + 1e-15L) + 1e-18L * all_terms + 1e-12L) return "I6 more power than allowed";
  // All of the wrench may pass, except for rounding in sums that nearly cancel.
  if (reported(kPower) && power < p.max_power_W * (1 - 1e-12L) - 1e-13L * all_terms - 1e-12L)
    return "I7 less power than allowed";
  return {};
}

}  // namespace wrenchd::test
