// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/lag_limiter.hpp"

#include <cmath>

namespace wrenchd {

/// METHOD (98).
double LagLimiter::scale(double energy, bool lags) noexcept {
  if (!lags) {
    energy_ = energy;
    return 1.0;
  }
  return energy > energy_ ? std::sqrt(energy_ / energy) : 1.0;
}

}  // namespace wrenchd
