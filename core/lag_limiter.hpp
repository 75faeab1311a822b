// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd {

/// Keeps a proxy that lags from building force: METHOD (98).
///
/// If the work limit of a tick ends a projection early, q stays behind although nothing may hold it. The
/// distance between p and q then grows with the hand's motion and says nothing about contact. So the wrench
/// is scaled down as if the energy of the spring had stopped to grow where the proxy last kept up. For a
/// fixed q the scaled force is still the gradient of a potential. All members are RT-safe.
class LagLimiter {
 public:
  /// Returns the factor, 0 to 1, for the wrench of this tick. energy: T(p, q) [kg m^2]. lags: true if the
  /// work limit ended the projection.
  double scale(double energy, bool lags) noexcept;

  /// Starts again, without energy. Call it if q was replaced.
  void reset() noexcept { energy_ = 0.0; }

 private:
  double energy_ = 0.0;  ///< T of the last tick in which the proxy kept up [kg m^2]
};

}  // namespace wrenchd
