// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Looks whether whoever armed is still there. It has to say so every 100 ms, beginning with the arming: a
/// watch that waits for a first sign of life would never begin where there is none. RT safe.
class ClientWatch {
 public:
  /// Somebody armed who promised to say that it lives.
  void begin(TimePoint now) noexcept {
    last_ = now;
    beaten_ = gone_ = false;
  }
  void beat(TimePoint now) noexcept {
    if (last_) last_ = now;
    beaten_ = true;
  }
  /// Its connection has ended: what the watch would find after 100 ms it finds now.
  void hang_up() noexcept { gone_ = last_.has_value(); }
  /// Nobody is armed any more.
  void end() noexcept { last_.reset(); }

  FaultSet look(TimePoint now) const noexcept;

 private:
  std::optional<TimePoint> last_;
  bool beaten_ = false;
  bool gone_ = false;
};

}  // namespace wrenchd
