// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"

namespace wrenchd {

// Time for which a condition must hold until it is a fault. The watches use these values, and the fault table
// shows them.
inline constexpr Duration kLateSample = std::chrono::milliseconds(3);  ///< a few reports at 1 kHz
inline constexpr Duration kStaleSample =
    std::chrono::milliseconds(20);  ///< default; the profile may set another value
inline constexpr Duration kStuckPose = std::chrono::milliseconds(20);
inline constexpr Duration kMotorsOff = std::chrono::milliseconds(20);  ///< longer than any round trip
inline constexpr Duration kLateAnswer = std::chrono::milliseconds(3);
inline constexpr Duration kLateTick = std::chrono::milliseconds(5);
inline constexpr Duration kStoppedLoop =
    std::chrono::milliseconds(20);  ///< default; the configuration may set another value
inline constexpr Duration kBlockedWrite = std::chrono::milliseconds(2);
inline constexpr Duration kFailedWrite = std::chrono::milliseconds(20);
inline constexpr Duration kOscillation = std::chrono::milliseconds(50);
inline constexpr Duration kMotorsStalled = std::chrono::seconds(1);
inline constexpr Duration kHeartbeatTimeout = std::chrono::milliseconds(100);
inline constexpr Duration kSelfTestTimeout = std::chrono::seconds(5);
inline constexpr Duration kSuspended = std::chrono::milliseconds(100);

}  // namespace wrenchd
