// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "daemon/servo/tick_record.hpp"

namespace wrenchd::test {

/// What has to hold in every tick, whatever happens, judged from the records alone and by none of the code
/// that is under test:
///
///   I1  what goes out is finite
///   I2  force and torque are within the profile's limits
///   I4  what grows, grows no faster than the slew limits
///   I5  force and driven motors in four states only (the self-test drives them with zero wrench)
///   I6  authority rises in one state only
///   I7  a latched state stays until somebody acknowledges, or the process ends
///   I8  a pose that is old never gives a rising force
///
/// I3, the direction, is a matter of one wrench and looked at by tests/support/limit_oracle.hpp.
class Invariants {
 public:
  struct Limits {
    double max_force_N, max_torque_Nm;
    double force_slew_N_per_s, torque_slew_Nm_per_s;
    double period_s;
    double stale_s;  ///< age from which a pose is old
  };

  explicit Invariants(const Limits& limits) : limits_(limits) {}

  /// The next record. What is broken, by its name and with the numbers; nothing else.
  std::optional<std::string> check(const TickRecord& record);

 private:
  Limits limits_;
  TickRecord last_;
  bool started_ = false;
};

}  // namespace wrenchd::test
