// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "daemon/servo/tick_record.hpp"

namespace wrenchd::test {

/// Invariants of every tick. They use only the records, not the code under test:
///
///   I1  the wrench sent is finite
///   I2  force and torque are within the profile's limits
///   I4  force and torque grow no faster than their slew limits
///   I5  there is force, and there are driven motors, in four states only (the self-test drives them with
///   zero wrench) I6  authority rises in one state only I7  a latched state lasts until an acknowledgement or
///   the end of the process I8  a stale pose never causes a rising force
///
/// I3, the direction, concerns a single wrench; tests/support/limit_oracle.hpp checks it.
class Invariants {
 public:
  struct Limits {
    double max_force_N, max_torque_Nm;
    double force_slew_N_per_s, torque_slew_Nm_per_s;
    double period_s;
    double stale_s;  ///< age from which a pose counts as stale
  };

  explicit Invariants(const Limits& limits) : limits_(limits) {}

  /// Checks the next record. Returns the violated invariant with its numbers; empty if none is violated.
  std::optional<std::string> check(const TickRecord& record);

 private:
  Limits limits_;
  TickRecord last_;
  bool started_ = false;
};

}  // namespace wrenchd::test
