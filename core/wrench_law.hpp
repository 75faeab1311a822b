// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/method.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Law that computes the wrench from the penetration.
enum class SpringLaw : std::uint8_t {
  pid,     ///< PID law, Eq. (16)
  energy,  ///< gradient of (k/2) T (core/energy_law.hpp), with the damping of Eq. (16)
};

/// Gains of Eq. (16), in the body frame T at the centre of mass: [f; tau] = K [v; w].
struct WrenchGains {
  Matrix6d stiffness = Matrix6d::Zero();  ///< K_P  [N/m, N; N, N.m/rad]
  Matrix6d integral = Matrix6d::Zero();   ///< K_I [N/(m.s), N/s; N/s, N.m/(rad.s)]
  Matrix6d damping = Matrix6d::Zero();    ///< K_D [N.s/m, N.s; N.s, N.m.s/rad]
  double integral_limit_N = 1.0;          ///< anti-windup: largest force of the integral term
  double integral_limit_Nm = 0.05;        ///< anti-windup: largest torque of the integral term
  double derivative_cutoff_Hz = 100.0;    ///< cut-off frequency of the first-order low pass on d eps/dt

  /// The paper's simplification K = k I with one number for force and torque.
  static Matrix6d scalar(double k) noexcept { return k * Matrix6d::Identity(); }
  /// Diagonal matrix with one gain for the force and one for the torque.
  static Matrix6d blockwise(double linear, double angular) noexcept {
    Matrix6d K = Matrix6d::Zero();
    K.diagonal() << linear, linear, linear, angular, angular, angular;
    return K;
  }
};

/// Gains for a method. The translational method derives its torque from the lever of its force, so both
/// halves use the mean force gain. The other methods use the gains unchanged. RT-safe.
WrenchGains gains_for(Method method, const WrenchGains& gains) noexcept;

/// The wrench law of Eq. (16), METHOD (60)-(62), core/METHOD.md, section 8.1:
///
///   W_T(t) = K_P eps(t) + K_I int eps dt + K_D d eps/dt
///
/// in the body frame, on the body, pulling p towards q. The derivative has a first-order low pass, the
/// integral has limits (anti-windup). Integral and derivative are reset when contact ends. All members are
/// RT-safe.
class WrenchLaw {
 public:
  explicit WrenchLaw(const WrenchGains& gains) : gains_(gains) {}

  /// Wrench of the law. eps: Eq. (15) or the drive of the method, in T. in_contact: false resets integral and
  /// derivative and returns zero. dt_s: time since the previous call; a value that is not positive leaves
  /// integral and derivative unchanged.
  Wrench update(const Vector6d& eps, bool in_contact, double dt_s) noexcept;

  /// The wrench spring + K_D d eps/dt, with another spring than K_P.
  Wrench update_damping(const Wrench& spring, const Vector6d& eps, bool in_contact, double dt_s) noexcept;
  void reset() noexcept;

  /// Scales the original gains: stiffness and integral by `spring`, damping by `damper`.
  void scale(double spring, double damper) noexcept;

 private:
  void integrate(const Vector6d& eps, double dt_s) noexcept;
  void differentiate(const Vector6d& eps, double dt_s) noexcept;

  WrenchGains gains_;
  WrenchGains base_gains_ = gains_;       ///< gains before scale()
  Vector6d last_eps_ = Vector6d::Zero();  ///< zero without contact, so eps starts from zero without a step
  Vector6d integral_ = Vector6d::Zero();
  Vector6d rate_ = Vector6d::Zero();
};

/// W_S = Ad_(p^-1)' W_T, METHOD (66): the wrench about the world origin, in world axes; paper, section 2.4.
/// RT-safe.
Wrench spatial_wrench(const Pose& X_WP, const Wrench& W_T) noexcept;

/// The wrench about the point p_W, in world axes. RT-safe.
Wrench wrench_about(const Vector3d& p_W, const Pose& X_WP, const Wrench& W_T) noexcept;

}  // namespace wrenchd
