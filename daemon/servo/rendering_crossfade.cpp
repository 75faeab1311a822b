// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/rendering_crossfade.hpp"

#include <algorithm>

namespace wrenchd {

RenderingCrossfade::Change RenderingCrossfade::update(bool driving) noexcept {
  if (!next_) {
    next_.reset(exchange_.take());
    if (!next_) return Change::none;
    next_weight_ = weight_rate_per_s_ = 0.0;
    next_->adopt_bodies(*active_);
    // The guess keeps the handle pose of the active proxy, and so the tool on its side of each wall.
    if (active_->proxy_valid())
      next_->initialize_near(active_->X_WQ() * inverse(active_->X_HT()) * next_->X_HT());
    if (driving) return Change::next_arrived;
  }
  if (driving && next_weight_ < 1.0) return Change::none;
  switch_to_next();
  return Change::switched;
}

/// Retires the outgoing rendering. The building thread destroys it, because the servo thread must not free
/// memory.
void RenderingCrossfade::switch_to_next() noexcept {
  exchange_.retire(active_.release());
  active_ = std::move(next_);
  next_weight_ = weight_rate_per_s_ = crossfade_work_J_ = 0.0;
}

bool RenderingCrossfade::project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept {
  const bool kept = active_->project(X_WH, now, scene_time_s);
  return (!next_ || next_->project(X_WH, now, scene_time_s)) && kept;
}

bool RenderingCrossfade::move(const Pose& X_WH) noexcept {
  const bool kept = active_->move(X_WH);
  return (!next_ || next_->move(X_WH)) && kept;
}

void RenderingCrossfade::undo_move() noexcept {
  active_->undo_move();
  if (next_) next_->undo_move();
}

void RenderingCrossfade::compute_wrench(double dt_s) noexcept {
  active_->compute_wrench(dt_s);
  if (next_) next_->compute_wrench(dt_s);
}

/// The fade begins when the next proxy is initialised, or when its search failed. It then continues to its
/// end.
bool RenderingCrossfade::fading() const noexcept {
  return next_ &&
         (weight_rate_per_s_ > 0.0 || next_->proxy_initialization() == ProxyInitialization::complete ||
          next_->proxy_initialization() == ProxyInitialization::failed);
}

/// METHOD (71).
Wrench RenderingCrossfade::blend(const Wrench& F_active, const Wrench& F_next, const FadeLimits& limits,
                                 double dt_s) noexcept {
  crossfade_work_J_ = 0.0;
  if (!fading()) return F_active;
  if (weight_rate_per_s_ == 0.0) {
    const auto fraction = [](double part, double whole) { return whole > 0.0 ? part / whole : 0.0; };
    const Wrench change = F_next - F_active;
    const double relative_change = std::max(fraction(change.force_N.norm(), limits.max_force_N),
                                            fraction(change.torque_Nm.norm(), limits.max_torque_Nm));
    weight_rate_per_s_ = 1.0 / std::max(kMinFade_s, std::min(relative_change, 1.0) * limits.rise_time_s);
  }
  const double last_weight = next_weight_;
  next_weight_ = std::min(next_weight_ + weight_rate_per_s_ * std::max(dt_s, 0.0), 1.0);
  crossfade_work_J_ = (next_weight_ - last_weight) * (next_->stored_energy_J() - active_->stored_energy_J());
  return (1.0 - next_weight_) * F_active + next_weight_ * F_next;
}

double RenderingCrossfade::stored_energy_J() const noexcept {
  if (!next_ || next_weight_ == 0.0) return active_->stored_energy_J();
  return (1.0 - next_weight_) * active_->stored_energy_J() + next_weight_ * next_->stored_energy_J();
}

double RenderingCrossfade::obstacle_work_J() const noexcept {
  if (!next_ || next_weight_ == 0.0) return active_->obstacle_work_J();
  return (1.0 - next_weight_) * active_->obstacle_work_J() + next_weight_ * next_->obstacle_work_J();
}

bool RenderingCrossfade::in_contact() const noexcept {
  return active_->in_contact() || (next_weight_ > 0.0 && next_->in_contact());
}

void RenderingCrossfade::reset_law() noexcept {
  active_->reset_law();
  if (next_) next_->reset_law();
}

bool RenderingCrossfade::invalidate_proxy() noexcept {
  const bool changed = next_ != nullptr;
  if (changed) switch_to_next();
  active_->invalidate_proxy();
  return changed;
}

}  // namespace wrenchd
