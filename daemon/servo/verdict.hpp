// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/state.hpp"

namespace wrenchd {

/// What the supervisor decides when a sample has arrived.
struct Verdict {
  State state = State::disconnected;
  bool sample_usable = false;  ///< The sample is new, whole and finite: the tool may follow it.
  bool release = false;        ///< The device is gone, or the loop shuts down: this tick releases the hand.
  bool invalidate_proxy = false;   ///< A command makes the proxy invalid; a new search follows.
  bool self_test_started = false;  ///< The loop is measured from this tick on.
  bool self_test_passed = false;   ///< The stiffness that stays passive can be derived from the measurement.

  bool armed() const noexcept { return is_driving(state) || state == State::waiting; }
};

}  // namespace wrenchd
