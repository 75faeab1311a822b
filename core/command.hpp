// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// Requests to the servo loop from outside. A bit mask: each tick applies all requests that arrived since the
/// previous tick, the safest first.
using CommandSet = std::uint16_t;
enum Command : CommandSet {
  kNoCommand = 0,
  kArm = 1,
  kDisarm = 2,
  kReinitialize = 4,  ///< invalidates the proxy and initializes it again from the handle pose
  kStop = 8,          ///< emergency stop
  kAcknowledge = 16,  ///< acknowledges a latched fault or an emergency stop
  kQuit = 32,         ///< ends the process
  kLease = 64,        ///< with kArm: the client that arms sends heartbeats; if they stop, the loop disarms
  kHeartbeat = 128,   ///< heartbeat of the client that armed
  kReleasedExternally = 256,  ///< force was released outside of the servo loop; appears only in records
  /// the connection of the client that armed has closed: the loop disarms without waiting for the timeout
  kClientLost = 512,
  kGrasp = 1024,  ///< the tool holds the free body that it touches, or the first one that it will touch
  kLetGo = 2048,
  kOtherHandReleased = 4096,  ///< a fault has released the other hand, which held the same body
};

}  // namespace wrenchd
