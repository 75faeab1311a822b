// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string_view>

namespace wrenchd {

/// Why the hand was released. In a tick a problem is a value, never an exception.
enum class Fault : std::uint8_t {
  none,
  device_lost,          ///< the transport says the device is gone
  pose_not_finite,      ///< NaN or infinity in a reported pose or twist
  pose_not_a_rotation,  ///< reported quaternion is too far from unit norm
  pose_teleported,      ///< pose moved farther in one report than any hand can
  overspeed,            ///< handle faster than the profile allows
  sample_stale,         ///< no new report for longer than the profile allows
  wrench_not_finite,    ///< the rendering produced NaN or infinity
  write_failed,         ///< the device did not take a wrench
};

/// What happened, in one sentence, and what to do about it.
struct FaultText {
  std::string_view name;  ///< as it stands in records and status: "device_lost"
  std::string_view sentence;
  std::string_view cure;
};

/// The text of a fault. Never fails: an unknown value reads "unknown".
FaultText text(Fault fault) noexcept;

}  // namespace wrenchd
