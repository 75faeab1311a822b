// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include <boost/lockfree/spsc_queue.hpp>

#include "core/clock.hpp"

namespace wrenchd {

/// Something worth a line in the log, as the servo thread says it: no text, no allocation.
struct Event {
  enum class Kind : std::uint8_t {
    engagement,          ///< detail: the new Engagement
    fault,               ///< detail: the Fault
    late_tick,           ///< value: how late [s]; the soft start began anew
    stale_sample,        ///< value: its age [s]; the wrench is zero until a new one comes
    reports_missing,     ///< detail: how many, by sequence number
    reports_rejected,    ///< detail: how many were short, long, of another id, garbled or out of order
    no_admissible_pose,  ///< the obstacles contradict each other where the hand is; the proxy stays
    placing,             ///< no admissible pose is known; zero wrench while one is looked for
    placed,              ///< value: how far from the hand it was found [m]
    nowhere,             ///< none was found; zero wrench, and it is looked for again
    released,            ///< the hand was released
  };
  Kind kind = Kind::engagement;
  TimePoint at{};
  std::uint32_t detail = 0;
  double value = 0.0;
};

/// From the servo thread to the log thread. When it is full, events are counted and dropped: the loop never
/// waits.
using EventRing = boost::lockfree::spsc_queue<Event, boost::lockfree::capacity<1024>>;

}  // namespace wrenchd
