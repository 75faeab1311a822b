// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/engagement.hpp"

#include <algorithm>

namespace wrenchd {

const char* name(Engagement state) noexcept {
  switch (state) {
    case Engagement::disarmed:
      return "disarmed";
    case Engagement::waiting:
      return "waiting";
    case Engagement::ramping:
      return "ramping";
    case Engagement::active:
      return "active";
  }
  return "unknown";
}

void SoftStart::arm() noexcept {
  if (state_ != Engagement::disarmed) return;
  state_ = Engagement::waiting;
  elapsed_s_ = 0.0;
}

void SoftStart::disarm() noexcept {
  state_ = Engagement::disarmed;
  elapsed_s_ = 0.0;
}

void SoftStart::interrupt() noexcept {
  if (state_ == Engagement::disarmed) return;
  state_ = Engagement::waiting;
  elapsed_s_ = 0.0;
}

double SoftStart::advance(bool calm, double dt_s) noexcept {
  elapsed_s_ += std::max(dt_s, 0.0);
  if (state_ == Engagement::waiting) {
    if (!calm) elapsed_s_ = 0.0;
    if (elapsed_s_ >= kCalmFor_s) {
      state_ = Engagement::ramping;
      elapsed_s_ = 0.0;
    }
  } else if (state_ == Engagement::ramping && elapsed_s_ >= ramp_s_) {
    state_ = Engagement::active;
  }
  if (state_ == Engagement::active) return 1.0;
  return state_ == Engagement::ramping && elapsed_s_ > 0.0 ? elapsed_s_ / ramp_s_ : 0.0;  // no ramp: not 0/0
}

}  // namespace wrenchd
