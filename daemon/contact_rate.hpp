// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/servo/loop_timing.hpp"

namespace wrenchd {

/// Reports the rate that a scene allows while CGAL detects the contacts ([rendering] contacts = "cgal").
/// CGAL's queries allocate memory and have no time limit, so only a measurement tells the rate. Not RT-safe:
/// allocates.
class ContactRateReport {
 public:
  struct Message {
    bool too_slow;  ///< the scene allows less than the rate of the loop
    std::string text;
  };

  /// rate_Hz: rate of the loop.
  explicit ContactRateReport(double rate_Hz) : rate_Hz_(rate_Hz) {}

  /// Returns what to log when the loop starts.
  static std::string start_text();

  /// Returns a report after the ticks of five seconds or after 20 overruns, and whenever the rate that the
  /// scene allows has fallen by a third since the last report. Call it now and then.
  std::optional<Message> check(const LoopTiming& timing);
  /// Returns the report of a run that ended before the first report.
  std::optional<Message> close(const LoopTiming& timing);

 private:
  Message report(double allowed_Hz);

  double rate_Hz_;
  double reported_Hz_ = 0.0;  ///< 0: no report yet
};

}  // namespace wrenchd
