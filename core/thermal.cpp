// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/thermal.hpp"

#include <algorithm>
#include <cmath>

#include "core/device_profile.hpp"
#include "core/finite.hpp"
#include "core/limits.hpp"

namespace wrenchd {
namespace {

/// Allowed heat above 1 while the ceiling decreases. The rest of kMaxHeat covers the tick in which the heat
/// reaches 1.
constexpr double kHeatRiseWhileFolding = 0.04;

bool is_positive(double x) noexcept {
  return is_finite(x) && x > 0.0;
}

/// Fraction of the distance to its steady state that the heat covers in dt.
double settling_fraction(double dt_s, double time_s) noexcept {
  return -std::expm1(-dt_s / time_s);
}

}  // namespace

MotorGroupHeat::MotorGroupHeat(double maximum, double continuous, double thermal_time_s) noexcept
    : maximum_(is_positive(maximum) ? maximum : 0.0),
      continuous_(continuous),
      time_s_(thermal_time_s),
      rated_(is_positive(continuous) && is_positive(thermal_time_s) && continuous < maximum_),
      ceiling_(maximum_) {
  if (!rated_) return;
  // F decreases linearly from r times the rating to the rating in the time t:
  //
  //   rise = (t / T) (mean of (F / continuous)^2 - 1) = (t / T) ((r^2 + r + 1) / 3 - 1)
  const double r = maximum_ / continuous_;
  fold_time_s_ = kHeatRiseWhileFolding * time_s_ / ((r * r + r + 1.0) / 3.0 - 1.0);
  ceiling_ = max_next_ceiling();
}

/// Largest effort for the next step that keeps the heat below kMaxHeat, at least the rating.
///
///   h' = h + a ((F / continuous)^2 - h) <= kMaxHeat
double MotorGroupHeat::max_next_ceiling() const noexcept {
  const double a = settling_fraction(kMaxStep_s, time_s_);
  const double square = heat_ + (kMaxHeat - heat_) / a;
  return std::min(maximum_, continuous_ * std::sqrt(std::max(square, 1.0)));
}

/// Keeps heat and ceiling, but the ceiling is clamped to the new maximum. If the old maximum was below the
/// rating, heat was not tracked; then the largest possible heat is assumed.
void MotorGroupHeat::set_maximum(double maximum) noexcept {
  if (maximum == maximum_) return;
  const MotorGroupHeat before = *this;
  *this = MotorGroupHeat(maximum, continuous_, time_s_);
  if (!rated_) return;
  const double share = before.maximum_ / continuous_;
  heat_ = before.rated_ ? before.heat_ : share * share;
  folded_ = before.folded_;
  ceiling_ = std::min({before.rated_ ? before.ceiling_ : max_next_ceiling(), max_next_ceiling(), maximum_});
}

void MotorGroupHeat::advance(double pushed, double dt_s) noexcept {
  if (!rated_ || !is_positive(dt_s)) return;
  const double share = (is_finite(pushed) ? std::min(pushed, maximum_) : maximum_) / continuous_;
  heat_ += settling_fraction(dt_s, time_s_) * (share * share - heat_);
  if (heat_ >= 1.0) folded_ = true;
  if (heat_ <= kRecoveryHeat) folded_ = false;
  const double step = (maximum_ - continuous_) * (dt_s / fold_time_s_);
  const double next = folded_ ? std::max(ceiling_ - step, continuous_) : std::min(ceiling_ + step, maximum_);
  ceiling_ = std::min(next, max_next_ceiling());
}

ThermalModel::ThermalModel(const DeviceProfile& profile, double max_force_N, double max_torque_Nm) noexcept
    : force_(max_force_N, profile.continuous_force_N, profile.thermal_time_s),
      torque_(max_torque_Nm, profile.continuous_torque_Nm, profile.thermal_time_s) {}

void ThermalModel::advance(const Wrench& F, double dt_s) noexcept {
  force_.advance(F.force_N.norm(), dt_s);
  torque_.advance(F.torque_Nm.norm(), dt_s);
}

}  // namespace wrenchd
