// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/external_wrench.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

/// A request during a fade continues from the wrench that the fade has reached.
void ExternalWrench::set(const ExternalWrenchRequest& request) noexcept {
  request_ = request;
  declared_J_ += request.energy_J;
  F_H_W_ = fade_ * F_H_W_;
  fade_ = 1.0;
}

ExternalWrench::Evaluation ExternalWrench::advance(TimePoint now, double dt_s) noexcept {
  const double passed_s = std::max(dt_s, 0.0);
  if (now < request_.expires)
    F_H_W_ = F_H_W_ - std::expm1(-passed_s / kTimeConstant_s) * (request_.F_H_W - F_H_W_);
  else
    fade_ = std::max(fade_ - passed_s / kFade_s, 0.0);
  if (fade_ == 0.0) F_H_W_ = Wrench{};
  const Evaluation result = {fade_ * F_H_W_, declared_J_, fade_ > 0.0};
  declared_J_ = 0.0;
  return result;
}

}  // namespace wrenchd
