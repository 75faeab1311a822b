// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/clock.hpp"

namespace wrenchd {

/// One thing that goes wrong with a simulated device, for a while. devices/README.md tells what each does.
struct SimulatedFault {
  enum class Kind : std::uint8_t {
    unplug,          ///< the device is gone; the link stays gone until it is opened again
    silence,         ///< no reports
    freeze,          ///< the last report again and again, sequence and all
    garble,          ///< one bit of each report is wrong, so a checksum is too
    short_report,    ///< half of each report
    bad_quaternion,  ///< orientation of half the length
    teleport,        ///< position 0.1 m off along x
    deaf,            ///< no room for commands
  };
  Kind kind = Kind::silence;
  Duration start{};  ///< since power-on
  Duration duration{};
};

/// What shall go wrong, and when. Any number of faults may overlap.
class FaultPlan {
 public:
  /// Not RT safe.
  void add(const SimulatedFault& fault) { faults_.push_back(fault); }
  /// From here times count. RT safe.
  void power_on(TimePoint now) noexcept { power_on_ = now; }
  /// Whether a fault of this kind shows at any moment from..to. RT safe.
  bool shows(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept;

 private:
  std::vector<SimulatedFault> faults_;
  TimePoint power_on_{};
};

}  // namespace wrenchd
