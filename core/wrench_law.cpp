// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/wrench_law.hpp"

#include <algorithm>
#include <numbers>

namespace wrenchd {

WrenchGains gains_for(Method method, const WrenchGains& gains) noexcept {
  if (method != Method::translational) return gains;
  const auto mean = [](const Matrix6d& K) noexcept { return K.topLeftCorner<3, 3>().trace() / 3.0; };
  WrenchGains out = gains;
  out.stiffness = WrenchGains::scalar(mean(gains.stiffness));
  out.integral = WrenchGains::scalar(mean(gains.integral));
  out.damping = WrenchGains::scalar(mean(gains.damping));
  return out;
}

// METHOD (60), Eq. (16)
Wrench WrenchLaw::update(const Vector6d& eps, bool in_contact, double dt_s) noexcept {
  if (!in_contact) {
    reset();
    return {};
  }
  if (dt_s > 0.0) {
    integrate(eps, dt_s);
    differentiate(eps, dt_s);
  }
  const Vector6d W_T = gains_.stiffness * eps + gains_.integral * integral_ + gains_.damping * rate_;
  return {W_T.head<3>(), W_T.tail<3>()};
}

Wrench WrenchLaw::update_damping(const Wrench& spring, const Vector6d& eps, bool in_contact,
                                 double dt_s) noexcept {
  if (!in_contact) {
    reset();
    return {};
  }
  if (dt_s > 0.0) differentiate(eps, dt_s);
  const Vector6d W_D = gains_.damping * rate_;
  return {spring.force_N + W_D.head<3>(), spring.torque_Nm + W_D.tail<3>()};
}

/// METHOD (62). Rectangle rule, then scales the integral so that its force and torque do not exceed their
/// limits.
void WrenchLaw::integrate(const Vector6d& eps, double dt_s) noexcept {
  integral_ += dt_s * eps;
  const Vector6d W_I = gains_.integral * integral_;
  const double force = W_I.head<3>().norm();
  const double torque = W_I.tail<3>().norm();
  double keep = 1.0;
  if (force > gains_.integral_limit_N) keep = std::min(keep, gains_.integral_limit_N / force);
  if (torque > gains_.integral_limit_Nm) keep = std::min(keep, gains_.integral_limit_Nm / torque);
  integral_ *= keep;
}

/// METHOD (61). First-order low pass by backward Euler, stable for any dt: pass = dt / (dt + 1/(2 pi f)).
void WrenchLaw::differentiate(const Vector6d& eps, double dt_s) noexcept {
  const double lag_s = 1.0 / (2.0 * std::numbers::pi * gains_.derivative_cutoff_Hz);
  const double pass = dt_s / (dt_s + lag_s);
  rate_ += pass * ((eps - last_eps_) / dt_s - rate_);
  last_eps_ = eps;
}

void WrenchLaw::scale(double spring, double damper) noexcept {
  gains_.stiffness = spring * base_gains_.stiffness;
  gains_.integral = spring * base_gains_.integral;
  gains_.damping = damper * base_gains_.damping;
}

void WrenchLaw::reset() noexcept {
  last_eps_.setZero();
  integral_.setZero();
  rate_.setZero();
}

Wrench spatial_wrench(const Pose& X_WP, const Wrench& W_T) noexcept {
  return wrench_about(Vector3d::Zero(), X_WP, W_T);
}

Wrench wrench_about(const Vector3d& p_W, const Pose& X_WP, const Wrench& W_T) noexcept {
  return shifted(expressed(X_WP.rotation, W_T), p_W - X_WP.translation_m);
}

}  // namespace wrenchd
