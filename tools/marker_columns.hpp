// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/control/json_rpc.hpp"
#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

/// The markers of a recording as columns beside the ticks: the label of the newest marker, and each
/// condition, which holds until a marker changes it. Not RT-safe: allocates.
class MarkerColumns {
 public:
  /// Throws RecordingError if the conditions of a marker are not a JSON object.
  explicit MarkerColumns(const Recording& recording);

  bool empty() const noexcept { return steps_.empty(); }
  /// Names of the conditions, in the order in which the markers set them first.
  const std::vector<std::string>& conditions() const noexcept { return conditions_; }

  /// A marker with all conditions that hold from its time on; null: not set yet.
  struct Step {
    std::int64_t time_ns = 0;
    std::string label;
    std::vector<Json> values;  ///< in the order of conditions()
  };
  /// Returns the newest marker at this time; null if there was none.
  const Step* at(std::int64_t now_ns) const noexcept;
  /// Markers in the order of their times.
  const std::vector<Step>& steps() const noexcept { return steps_; }

 private:
  std::vector<std::string> conditions_;
  std::vector<Step> steps_;
};

}  // namespace wrenchd
