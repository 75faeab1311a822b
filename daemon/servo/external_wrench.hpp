// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The request of a program that lets a robot or a simulator act on the hand.
struct ExternalWrenchRequest {
  static constexpr double kMaxLifetime_s = 1.0;  ///< Longest time from a request to its expiry.

  Wrench F_H_W;  ///< Wrench on the hand, about the handle point, in axes of W.
  /// Energy that the wrench may give to the hand from now on, in addition to the work of the hand against it
  /// [J].
  double energy_J = 0.0;
  TimePoint expires{};  ///< Time from which the wrench fades to zero.
};

/// Computes the external wrench from the last request. The wrench changes exponentially with a time constant
/// of kTimeConstant_s, and falls to zero within kFade_s after the request has expired, so that nothing jumps
/// when the program that sends it dies. WorkAccount bounds its work. All members are RT-safe.
class ExternalWrench {
 public:
  static constexpr double kTimeConstant_s = 0.005;
  static constexpr double kFade_s = 0.050;

  /// Replaces the request. Its energy adds up until advance() returns it.
  void set(const ExternalWrenchRequest& request) noexcept;

  struct Evaluation {
    Wrench F_H_W;             ///< Wrench on the hand, about the handle point, in axes of W.
    double declared_J = 0.0;  ///< Energy that was declared since the previous call.
    bool active = false;      ///< False: there is no request, or its wrench has faded out.
  };
  /// Advances by dt_s [s].
  Evaluation advance(TimePoint now, double dt_s) noexcept;

 private:
  ExternalWrenchRequest request_;
  Wrench F_H_W_;             ///< Wrench that follows the requested one.
  double fade_ = 0.0;        ///< Factor on F_H_W_, 0 to 1.
  double declared_J_ = 0.0;  ///< Energy that was declared since the last advance().
};

}  // namespace wrenchd
