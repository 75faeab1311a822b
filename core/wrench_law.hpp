// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/method.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// What makes a wrench of a penetration.
enum class SpringLaw : std::uint8_t {
  pid,     ///< Eq. (16)
  energy,  ///< the gradient of (k/2) T (core/energy_law.hpp), with the damping of Eq. (16)
};

/// Gains of Eq. (16), in the body frame T at the centre of mass: [f; tau] = K [v; w].
struct WrenchGains {
  Matrix6d stiffness = Matrix6d::Zero();  ///< K_P  [N/m, N; N, N.m/rad]
  Matrix6d integral = Matrix6d::Zero();   ///< K_I  the same per second
  Matrix6d damping = Matrix6d::Zero();    ///< K_D  the same times second
  double integral_limit_N = 1.0;          ///< anti-windup: the most force that K_I may contribute
  double integral_limit_Nm = 0.05;        ///< and the most torque
  double derivative_cutoff_Hz = 100.0;    ///< first-order low pass on d eps/dt

  /// The paper's simplification K = k I, for which one number stands for both halves.
  static Matrix6d scalar(double k) noexcept { return k * Matrix6d::Identity(); }
  /// One gain for the force and one for the torque.
  static Matrix6d blockwise(double linear, double angular) noexcept {
    Matrix6d K = Matrix6d::Zero();
    K.diagonal() << linear, linear, linear, angular, angular, angular;
    return K;
  }
};

/// The gains a method's drive asks for. The translational method's torque is the lever of its force, so both
/// halves take the mean force gain; the other methods take the gains as they are.
WrenchGains gains_for(Method method, const WrenchGains& gains) noexcept;

/// The wrench law of Eq. (16):
///
///   W_T(t) = K_P eps(t) + K_I int eps dt + K_D d eps/dt
///
/// in the body frame, on the body, pulling p towards q. The derivative passes a first-order low pass; the
/// integral stops at its limits (anti-windup); both are forgotten when contact ends, so that a new contact
/// starts clean.
class WrenchLaw {
 public:
  explicit WrenchLaw(const WrenchGains& gains) : gains_(gains) {}

  /// eps: Eq. (15) or what the method puts in its place, in T. in_contact: false forgets integral and
  /// derivative and gives zero. dt_s: time since the last call; not positive means no time has passed. RT
  /// safe.
  Wrench update(const Vector6d& eps, bool in_contact, double dt_s) noexcept;

  /// The same with another spring:  W_T(t) = spring + K_D d eps/dt.  RT safe.
  Wrench update_damping(const Wrench& spring, const Vector6d& eps, bool in_contact, double dt_s) noexcept;
  void reset() noexcept;

  /// As much of the gains it was made with. RT safe.
  void scale(double spring, double damper) noexcept;

 private:
  void integrate(const Vector6d& eps, double dt_s) noexcept;
  void differentiate(const Vector6d& eps, double dt_s) noexcept;

  WrenchGains gains_;
  WrenchGains base_gains_ = gains_;       ///< before any scale()
  Vector6d last_eps_ = Vector6d::Zero();  ///< zero outside contact: eps grows from zero, without a step
  Vector6d integral_ = Vector6d::Zero();
  Vector6d rate_ = Vector6d::Zero();
};

/// W_S = Ad_(p^-1)' W_T: the wrench about the world origin, in world axes (section 2.4). RT safe.
Wrench spatial_wrench(const Pose& X_WP, const Wrench& W_T) noexcept;

/// The wrench about a point given in the world, in world axes. RT safe.
Wrench wrench_about(const Vector3d& p_W, const Pose& X_WP, const Wrench& W_T) noexcept;

}  // namespace wrenchd
