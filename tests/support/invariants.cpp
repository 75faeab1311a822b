// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/invariants.hpp"

#include <cmath>
#include <cstring>
#include <sstream>

namespace wrenchd::test {
namespace {

// The states and commands of core/state.hpp and core/command.hpp as separate numbers: an oracle must not
// depend on the code under test.
constexpr int kRamping = 4, kActive = 5, kDegraded = 6, kReleasing = 7, kFault = 8, kStopped = 9,
              kShutdown = 10;
constexpr int kSelfTest = 1;
constexpr int kAcknowledged = 16, kQuitOrEnd = 32 | 256;

double length(const double* v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

bool finite_bits(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return (bits >> 52 & 0x7ff) != 0x7ff;
}

bool drives(int state) {
  return state == kRamping || state == kActive || state == kDegraded || state == kReleasing;
}

template <class... Parts>
std::string violation_text(const TickRecord& r, const Parts&... parts) {
  std::ostringstream text;
  text << "tick " << r.tick << " state " << static_cast<int>(r.state) << ": ";
  (text << ... << parts);
  return text.str();
}

}  // namespace

std::optional<std::string> Invariants::check(const TickRecord& r) {
  const TickRecord before = last_;
  const bool begun = started_;
  last_ = r;
  started_ = true;
  const double F = length(&r.F_out[0]), T = length(&r.F_out[3]);
  for (const double x : r.F_out)
    if (!finite_bits(x)) return violation_text(r, "I1 not finite");
  if (!(F <= limits_.max_force_N) || !(T <= limits_.max_torque_Nm))
    return violation_text(r, "I2 ", F, " N ", T, " N.m");
  const int state = r.state;
  const bool force = F > 0.0 || T > 0.0;
  if (force && !drives(state)) return violation_text(r, "I5 force in a state without: ", F, " N ", T, " N.m");
  if (r.motors_commanded != 0 && !drives(state) && state != kSelfTest)
    return violation_text(r, "I5 motors on");
  if (r.authority > 0.0 && !drives(state)) return violation_text(r, "I5 authority ", r.authority);
  if (!begun) return {};

  // A tick may last up to two periods.
  const double dt_s = 2.0 * limits_.period_s;
  const double last_F = length(&before.F_out[0]), last_T = length(&before.F_out[3]);
  if (F > last_F + limits_.force_slew_N_per_s * dt_s * (1.0 + 1e-9) ||
      T > last_T + limits_.torque_slew_Nm_per_s * dt_s * (1.0 + 1e-9))
    return violation_text(r, "I4 from ", last_F, " to ", F, " N, ", last_T, " to ", T, " N.m");
  // The ramp ends in the first tick of `active`. A tick whose write was rejected ends in another state.
  const bool rose =
      state == kRamping || (before.state == kRamping && (state == kActive || r.write_fault != Fault::none));
  if (r.authority > before.authority && !rose)
    return violation_text(r, "I6 authority from ", before.authority, " to ", r.authority);
  const bool latched = before.state == kFault || before.state == kStopped;
  if (latched && state != kFault && state != kStopped && (r.commands & (kAcknowledged | kQuitOrEnd)) == 0)
    return violation_text(r, "I7 left ", static_cast<int>(before.state));
  if (latched && state == kShutdown && (r.commands & kQuitOrEnd) == 0) return violation_text(r, "I7 ended");
  const double age_s = 1e-9 * static_cast<double>(r.now_ns - r.arrived_ns);
  if (age_s > limits_.stale_s && (F > last_F * (1.0 + 1e-9) || T > last_T * (1.0 + 1e-9)))
    return violation_text(r, "I8 age ", age_s, " s, from ", last_F, " to ", F, " N");
  return {};
}

}  // namespace wrenchd::test
