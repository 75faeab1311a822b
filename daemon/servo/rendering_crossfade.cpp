// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/rendering_crossfade.hpp"

#include <algorithm>

namespace wrenchd {

Renderings::News Renderings::change(bool force) noexcept {
  if (!next_) {
    next_.reset(exchange_.take());
    if (!next_) return News::none;
    share_ = per_s_ = 0.0;
    // Where the handle is the same, and the tool on the side of each wall where it was.
    if (felt_->has_place()) next_->seek_near(felt_->X_WQ() * inverse(felt_->X_HT()) * next_->X_HT());
    if (force) return News::comes;
  }
  if (force && share_ < 1.0) return News::none;
  take_over();
  return News::taken_over;
}

/// What goes is never destroyed here: the other side of the exchange does that.
void Renderings::take_over() noexcept {
  exchange_.give_back(felt_.release());
  felt_ = std::move(next_);
  share_ = per_s_ = given_J_ = 0.0;
}

bool Renderings::project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept {
  const bool kept = felt_->project(X_WH, now, scene_time_s);
  return (!next_ || next_->project(X_WH, now, scene_time_s)) && kept;
}

void Renderings::press(double dt_s) noexcept {
  felt_->press(dt_s);
  if (next_) next_->press(dt_s);
}

/// Is there something to fade to: the proxy follows, or there is no room for it?
bool Renderings::fades() const noexcept {
  return next_ &&
         (per_s_ > 0.0 || next_->placing() == Placing::following || next_->placing() == Placing::nowhere);
}

Wrench Renderings::mixed(const Wrench& F_felt, const Wrench& F_next, const Pace& pace, double dt_s) noexcept {
  given_J_ = 0.0;
  if (!fades()) return F_felt;
  if (per_s_ == 0.0) {
    const auto share_of = [](double part, double whole) { return whole > 0.0 ? part / whole : 0.0; };
    const Wrench change = F_next - F_felt;
    const double far = std::max(share_of(change.force_N.norm(), pace.max_force_N),
                                share_of(change.torque_Nm.norm(), pace.max_torque_Nm));
    per_s_ = 1.0 / std::max(kLeastFade_s, std::min(far, 1.0) * pace.over_s);
  }
  const double last = share_;
  share_ = std::min(share_ + per_s_ * std::max(dt_s, 0.0), 1.0);
  given_J_ = (share_ - last) * (next_->wound_up_J() - felt_->wound_up_J());
  return (1.0 - share_) * F_felt + share_ * F_next;
}

double Renderings::wound_up_J() const noexcept {
  if (!next_ || share_ == 0.0) return felt_->wound_up_J();
  return (1.0 - share_) * felt_->wound_up_J() + share_ * next_->wound_up_J();
}

double Renderings::pushed_J() const noexcept {
  if (!next_ || share_ == 0.0) return felt_->pushed_J();
  return (1.0 - share_) * felt_->pushed_J() + share_ * next_->pushed_J();
}

bool Renderings::in_contact() const noexcept {
  return felt_->in_contact() || (share_ > 0.0 && next_->in_contact());
}

void Renderings::lose_law() noexcept {
  felt_->lose_law();
  if (next_) next_->lose_law();
}

bool Renderings::lose_place() noexcept {
  const bool comes = next_ != nullptr;
  if (comes) take_over();
  felt_->lose_place();
  return comes;
}

}  // namespace wrenchd
