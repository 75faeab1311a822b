// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include <boost/lockfree/spsc_queue.hpp>

#include "core/clock.hpp"

namespace wrenchd {

/// Something worth a line in the log, as the servo thread says it: no text, no allocation.
struct Event {
  enum class Kind : std::uint8_t {
    state_changed,     ///< detail: the new State; value: the Fault that led to it, as a number
    fault_raised,      ///< detail: the Fault; value: how much of it, where that says something
    stiffness_scaled,  ///< value: the share of the spring that stays passive on this device, where less than
                       ///< 1
    stability_bound_unknown,  ///< the profile states no damping, so nobody knows how stiff a wall may be
    arming_refused,           ///< detail: the State in which it was asked to arm, and was not
    projection_infeasible,    ///< the obstacles contradict each other where the hand is; the proxy stays
    proxy_search_started,     ///< no admissible pose is known; zero wrench while one is looked for
    proxy_found,              ///< value: how far from the hand it was found [m]
    proxy_search_failed,      ///< none was found; zero wrench, and it is looked for again
    released,                 ///< the hand was released
    crossfade_started,        ///< detail: number of a rendering that begins to take the place of another
    rendering_changed,        ///< detail: number of the rendering that is felt from now on
  };
  Kind kind = Kind::state_changed;
  TimePoint at{};
  std::uint32_t detail = 0;
  double value = 0.0;
};

/// From the servo thread to the log thread. When it is full, events are counted and dropped: the loop never
/// waits.
using EventRing = boost::lockfree::spsc_queue<Event, boost::lockfree::capacity<1024>>;

}  // namespace wrenchd
