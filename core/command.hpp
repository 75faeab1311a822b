// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// What can be asked of the servo loop from outside. A bit mask: a tick takes all that was asked for since
/// the last one, the safest first.
using CommandSet = std::uint16_t;
enum Command : CommandSet {
  kNoCommand = 0,
  kArm = 1,
  kDisarm = 2,
  kReinitialize = 4,          ///< last tick's q means nothing any more
  kStop = 8,                  ///< emergency stop
  kAcknowledge = 16,          ///< somebody has looked at a fault, or a stop
  kQuit = 32,                 ///< the process is asked to end
  kLease = 64,                ///< with kArm: whoever arms promises signs of life
  kHeartbeat = 128,           ///< a sign of life
  kReleasedExternally = 256,  ///< the hand was released from outside: only in records
  kClientLost = 512,          ///< whoever promised signs of life is gone: no need to wait for its silence
};

}  // namespace wrenchd
