// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include <boost/lockfree/spsc_queue.hpp>

#include "core/clock.hpp"

namespace wrenchd {

/// Something worth a line in the log, as the servo thread says it: no text, no allocation.
struct Event {
  enum class Kind : std::uint8_t {
    state,      ///< detail: the new State; value: the Fault that led to it, as a number
    fault,      ///< detail: the Fault; value: how much of it, where that says something
    stiffness,  ///< value: the share of the spring that stays passive on this device, where less than 1
    unbounded,  ///< the profile states no damping, so nobody knows how stiff a wall may be
    refused,    ///< detail: the State in which it was asked to arm, and was not
    no_admissible_pose,  ///< the obstacles contradict each other where the hand is; the proxy stays
    placing,             ///< no admissible pose is known; zero wrench while one is looked for
    placed,              ///< value: how far from the hand it was found [m]
    nowhere,             ///< none was found; zero wrench, and it is looked for again
    released,            ///< the hand was released
    changing,            ///< detail: number of a rendering that begins to take the place of another
    changed,             ///< detail: number of the rendering that is felt from now on
  };
  Kind kind = Kind::state;
  TimePoint at{};
  std::uint32_t detail = 0;
  double value = 0.0;
};

/// From the servo thread to the log thread. When it is full, events are counted and dropped: the loop never
/// waits.
using EventRing = boost::lockfree::spsc_queue<Event, boost::lockfree::capacity<1024>>;

}  // namespace wrenchd
