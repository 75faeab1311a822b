// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/renderer.hpp"

#include <algorithm>
#include <utility>

#include "core/finite.hpp"
#include "core/state_machine.hpp"

namespace wrenchd {
namespace {

/// How long the contact wrench takes to fade out, and to come back, when the workspace changes [s].
constexpr double kContactFadeOut_s = 0.050;
constexpr double kContactFadeIn_s = 0.100;

/// A device whose wrench is about another point gets the wrench of its measured pose.
DofMask sensed_at_handle(const DeviceProfile& profile) noexcept {
  return profile.wrench_point == WrenchPoint::handle ? sensed_dofs(profile) : kNoDof;
}

}  // namespace

Renderer::Renderer(const Settings& settings, const DeviceProfile& profile,
                   std::unique_ptr<Rendering> rendering, RenderingExchange& exchange, EventQueue& events)
    : events_(events),
      wrench_point_(profile.wrench_point),
      driven_(driven_dofs(profile)),
      grasp_button_(button_bit(profile.grasp_button)),
      recentre_button_(button_bit(profile.recentre_button)),
      crossfade_(std::move(rendering), exchange),
      workspace_(settings.device.base_in_world.pose()),
      gravity_(profile.masses, settings.device.base_in_world.pose().rotation),
      stability_(settings, profile, active().stability()),
      undriven_(sensed_at_handle(profile), driven_, stated_encoder_step(profile)) {
  invalidate_proxy({});
}

std::uint32_t Renderer::apply(const Requests& requests, const Verdict& verdict, const DeviceReading& reading,
                              const TickTime& t) noexcept {
  demand_.interrupted = demand_.proxy_invalidated = false;
  if (verdict.self_test_started) stability_.start_measurement();
  if (verdict.invalidate_proxy) invalidate_proxy(t.now);
  handle_buttons(reading.sample.buttons, t.now);
  change_rendering(is_driving(verdict.state), t);
  update_grasp(requests.commands);
  if (requests.workspace) change_workspace(*requests.workspace);
  if (requests.local_models) {
    ++change_count_;
    local_models_.set_models(*requests.local_models);
    local_model_scale_ = stability_.max_stable_scale(local_models_.total_gains());
  }
  if (requests.limits) ++change_count_;
  if (requests.external_wrench) external_wrench_.set(*requests.external_wrench);
  stability_.update_measurement(reading.sample, reading.last_command_sent, t.now);
  return change_count_;
}

/// Where no force is on the hand, a new rendering replaces the active one at once, and its proxy is searched
/// for.
void Renderer::change_rendering(bool driving, const TickTime& t) noexcept {
  switch (crossfade_.update(driving)) {
    case RenderingCrossfade::Change::none:
      return;
    case RenderingCrossfade::Change::next_arrived:
      scale_renderings();
      events_.emit(t.now, Event::CrossfadeStarted{crossfade_.next()->id()});
      ++change_count_;
      return;
    case RenderingCrossfade::Change::switched:
      adopt_rendering(t.now);
      if (driving && proxy_valid()) return;
      invalidate_proxy(t.now);
      demand_.interrupted = true;
  }
}

/// When the clutch is released, the tool continues from the proxy: it touches without pressing.
void Renderer::change_workspace(const WorkspaceRequest& request) noexcept {
  ++change_count_;
  workspace_.set_scale(request.scale);
  if (request.clutched && !workspace_.clutched()) workspace_.engage_clutch();
  if (!request.clutched && workspace_.clutched())
    workspace_.disengage_clutch(proxy_valid() ? active().X_WQ() * inverse(active().X_HT())
                                              : workspace_.X_WH());
  recentre_pending_ = recentre_pending_ || request.recentre_count != recentre_count_;
  recentre_count_ = request.recentre_count;
  contact_muted_ = request.clutched || recentre_pending_;
}

/// The recentre button. Of a device with motors the contact wrench fades out first; one without motors is
/// steered, and no force can jump.
void Renderer::handle_buttons(std::uint32_t buttons, TimePoint now) noexcept {
  const bool pressed = (buttons & ~buttons_ & recentre_button_) != 0;
  if (((buttons ^ buttons_) & grasp_button_) != 0) grasp_wanted_ = (buttons & grasp_button_) != 0;
  buttons_ = buttons;
  if (!pressed) return;
  if (driven_ == kNoDof)
    recentre(now);
  else
    recentre_pending_ = contact_muted_ = true;
}

void Renderer::update_grasp(CommandSet commands) noexcept {
  if ((commands & kGrasp) != 0) grasp_wanted_ = true;
  if ((commands & kLetGo) != 0) grasp_wanted_ = false;
  crossfade_.active().set_grasp(grasp_wanted_);
  if (Rendering* next = crossfade_.next()) next->set_grasp(grasp_wanted_);
}

/// A grasp that broke is not taken again until it is asked for again.
void Renderer::report_grasp(TimePoint now) noexcept {
  const auto held = static_cast<std::uint32_t>(active().held_body());
  if (held == held_body_) return;
  const bool broke = active().grasp_broke();
  if (broke) grasp_wanted_ = false;
  if (held_body_ != 0) events_.emit(now, Event::LetGo{held_body_, broke});
  if (held != 0) events_.emit(now, Event::Grasped{held});
  held_body_ = held;
}

void Renderer::recentre(TimePoint now) noexcept {
  workspace_.recentre();
  invalidate_proxy(now);
  demand_.interrupted = true;
}

/// The proxy is unknown: no contact, zero wrench. The rendering that is being faded in becomes active.
void Renderer::invalidate_proxy(TimePoint now) noexcept {
  if (crossfade_.invalidate_proxy()) adopt_rendering(now);
  grasp_wanted_ = false;
  demand_.F_contact = demand_.F_weight = Wrench{};
  demand_.undriven = kNoDof;
  demand_.proxy_invalidated = true;
  undriven_.reset();
}

void Renderer::adopt_rendering(TimePoint now) noexcept {
  stability_.set_analysis(active().stability());
  scale_renderings();
  events_.emit(now, Event::RenderingChanged{active().id()});
  ++change_count_;
}

void Renderer::scale_renderings() noexcept {
  crossfade_.active().set_stiffness_scale(stability_.scale());
  if (Rendering* next = crossfade_.next())
    next->set_stiffness_scale(stability_.max_stable_scale(next->stability()));
  undriven_.set_loop(stability_.stiffness_at_handle(), stability_.longest_lag_s());
}

/// Reports the share of the stiffness that stays passive, if it is another one than the reported one.
void Renderer::report_scale(TimePoint now) noexcept {
  const double scale = stability_.scale().spring;
  if (scale == reported_scale_) return;
  reported_scale_ = scale;
  events_.emit(now, Event::StiffnessScaled{scale});
}

EnergyBounds Renderer::derive_stiffness(const TickTime& t) noexcept {
  const auto [spring, damper, bound_known] = stability_.derive();
  scale_renderings();
  if (!bound_known) events_.emit(t.now, Event::StabilityBoundUnknown{});
  reported_scale_ = spring;
  if (spring < 1.0 || damper < 1.0) events_.emit(t.now, Event::StiffnessScaled{spring});
  return stability_.energy_bounds();
}

ContactState Renderer::project(const DeviceSample& sample, const Verdict& verdict, double sent_share,
                               const TickTime& t) noexcept {
  const double scale_before = stability_.scale().spring;
  if (verdict.sample_usable && !follow_driven(sample, sent_share, t)) {  // trapped between moving obstacles
    invalidate_proxy(t.now);
    demand_.interrupted = true;
  }
  report_grasp(t.now);
  // While the workspace scale glides, the share changes each tick; its end value is reported.
  if (stability_.scale().spring == scale_before) report_scale(t.now);
  return contact();
}

/// Moves the renderings to the sample's pose. On a device that senses motion which no motor drives, they
/// follow that motion only as far as they stay passive: core/METHOD.md, section 11.5. Returns false if moving
/// obstacles trap a proxy.
bool Renderer::follow_driven(const DeviceSample& sample, double sent_share, const TickTime& t) noexcept {
  bool first = true, kept = true;
  Pose X_BH_now, X_BH_before;
  const auto move = [&](const Pose& X_BH) {
    const Pose X_WH = workspace_.update(X_BH, first ? t.dt_s : 0.0);
    if (first && stability_.set_workspace_scale(workspace_.scale())) scale_renderings();
    kept = (first ? crossfade_.project(X_WH, t.now, t.scene_time_s) : crossfade_.move(X_WH)) && kept;
    first = false;
    X_BH_before = std::exchange(X_BH_now, X_BH);
  };
  const auto undo = [&] {
    crossfade_.undo_move();
    X_BH_now = X_BH_before;
    workspace_.update(X_BH_now, 0.0);
  };
  const bool held = active().proxy_initialization() == ProxyInitialization::complete;
  if (!undriven_.active() || !held) {
    undriven_.reset();
    move(sample.X_BH);
    return kept;
  }
  undriven_.set_share(contact_gain_ * sent_share);
  const auto render = [&](const Pose& X_BH) {
    move(X_BH);
    return spring_state();
  };
  undriven_.follow(sample.X_BH, sample.device_time_s, render, undo);
  return kept;
}

/// While two renderings fade, and while a proxy lags, the potential is not known, and undriven motion waits.
SpringState Renderer::spring_state() const noexcept {
  const Rendering& rendering = active();
  SpringState state;
  state.known =
      crossfade_.next() == nullptr && rendering.depth().projection.status != ProjectionStatus::budget_spent;
  state.U_J = rendering.spring_potential_J();
  state.F_B = on_hand(rendering, rendering.spring_F_T());
  return state;
}

ContactState Renderer::contact() const noexcept {
  const Rendering& rendering = active();
  const Penetration& depth = rendering.depth();
  ContactState c;
  c.X_WH = workspace_.X_WH();
  c.X_WP = rendering.X_WP();
  c.X_WQ = rendering.X_WQ();
  c.proxy_valid = rendering.proxy_valid();
  c.initialization = rendering.proxy_initialization();
  c.X_WB = rendering.X_WB();
  c.eps = depth.eps;
  c.energy = depth.projection.energy;
  c.kkt_residual = depth.projection.kkt_residual;
  c.contacts = depth.contacts;
  c.iterations = depth.projection.iterations;
  c.status = depth.projection.status;
  c.X_BH_held = held_pose();
  c.undriven_lag_rad = undriven_.lag_rad();
  c.undriven_account_J = undriven_.account_J();
  c.rendering_id = rendering.id();
  c.rendering_checksum = rendering.checksum();
  c.crossfading = crossfade_.next() != nullptr;
  return c;
}

Demand Renderer::current_demand() const noexcept {
  Demand demand = demand_;
  demand.sample_usable = false;
  demand.F_T = active().F_T();
  demand.contact = contact();
  return demand;
}

std::optional<Pose> Renderer::held_pose() const noexcept {
  if (active().proxy_initialization() != ProxyInitialization::complete || workspace_.clutched()) return {};
  return workspace_.pose_in_base(active().X_WQ() * inverse(active().X_HT()));
}

Demand Renderer::compute_wrench(const ContactState& contact, const DeviceSample& sample,
                                const Verdict& verdict, const RenderingCrossfade::FadeLimits& limits,
                                const TickTime& t) noexcept {
  bool recentred = false;
  demand_.sample_usable = verdict.sample_usable;
  demand_.crossfade_work_J = demand_.obstacle_work_J = demand_.local_model_work_J = 0.0;
  if (verdict.sample_usable) recentred = compute_demand(sample, limits, t);
  advance_external_wrench(t);
  demand_.contact_gain = contact_gain_;
  demand_.next_rendering_weight = crossfade_.next_weight();
  demand_.in_contact = crossfade_.in_contact() && contact_gain_ > 0.0;
  demand_.stored_energy_J = contact_gain_ * crossfade_.stored_energy_J();
  demand_.calm = calm_condition(contact, sample, limits);
  demand_.F_T = active().F_T();
  demand_.contact = contact;
  Demand demand = demand_;
  const bool finite = is_finite(demand.F_contact + demand.F_weight);
  if (!finite) invalidate_proxy(t.now);  // the next tick must not start from the pose that produced it
  if (!finite || recentred) demand.contact = demand_.contact = this->contact();
  return demand;
}

/// Line 7 of Algorithm 1. Returns true if it recentred the workspace. The law runs on the device's clock,
/// which knows when the poses were taken.
bool Renderer::compute_demand(const DeviceSample& sample, const RenderingCrossfade::FadeLimits& limits,
                              const TickTime& t) noexcept {
  const double dt_s = has_sample_time_ ? sample.device_time_s - sample_time_s_ : 0.0;
  sample_time_s_ = sample.device_time_s;
  has_sample_time_ = true;
  crossfade_.compute_wrench(dt_s);
  Wrench F = contact_wrench(active());
  if (const Rendering* next = crossfade_.next())
    F = crossfade_.blend(F, contact_wrench(*next), limits, t.dt_s);
  const bool recentred = update_contact_gain(t);
  const Wrench F_weight = gravity_.wrench(sample.X_BH);
  F = contact_gain_ * F + local_model_wrench(sample, t);
  demand_.undriven = static_cast<DofMask>(nonzero_dofs(F + F_weight) & ~driven_);
  demand_.F_contact = restrict_to_dofs(F, driven_);
  demand_.F_weight = restrict_to_dofs(F_weight, driven_);
  return recentred;
}

/// About the handle point in the axes of the device base, or the paper's spatial wrench W_S: as the profile
/// says.
Wrench Renderer::contact_wrench(const Rendering& rendering) const noexcept {
  if (wrench_point_ == WrenchPoint::world_origin) return spatial_wrench(rendering.X_WP(), rendering.F_T());
  return on_hand(rendering, rendering.F_T());
}

Wrench Renderer::on_hand(const Rendering& rendering, const Wrench& F_T) const noexcept {
  return workspace_.wrench_on_hand(wrench_about(workspace_.X_WH().translation_m, rendering.X_WP(), F_T));
}

Wrench Renderer::local_model_wrench(const DeviceSample& sample, const TickTime& t) noexcept {
  if (wrench_point_ == WrenchPoint::world_origin) return {};
  const LocalModels::Evaluation models = local_models_.evaluate(
      workspace_.X_WH(), workspace_.twist_in_world(sample.V_BH), t.now, t.dt_s, local_model_scale_);
  demand_.local_model_work_J = models.crossfade_work_J;
  return models.any_active ? workspace_.wrench_on_hand(models.F_H_W) : Wrench{};
}

/// In each tick, also without a usable sample: a wrench whose program has died must fade.
void Renderer::advance_external_wrench(const TickTime& t) noexcept {
  demand_.F_external = Wrench{};
  const ExternalWrench::Evaluation external = external_wrench_.advance(t.now, t.dt_s);
  demand_.external_declared_J = external.declared_J;
  demand_.external_active = external.active && wrench_point_ == WrenchPoint::handle;
  if (!demand_.external_active) return;
  const Wrench F = workspace_.wrench_on_hand(external.F_H_W);
  demand_.undriven = static_cast<DofMask>(demand_.undriven | (nonzero_dofs(F) & ~driven_));
  demand_.F_external = restrict_to_dofs(F, driven_);
}

/// Ramps the share of the contact wrench that goes out, and recentres the workspace if that waits for it to
/// reach 0. Returns true if it did.
bool Renderer::update_contact_gain(const TickTime& t) noexcept {
  const double previous = contact_gain_;
  if (contact_muted_) contact_gain_ = std::max(contact_gain_ - t.dt_s / kContactFadeOut_s, 0.0);
  if (!contact_muted_) contact_gain_ = std::min(contact_gain_ + t.dt_s / kContactFadeIn_s, 1.0);
  demand_.crossfade_work_J =
      (contact_gain_ - previous) * crossfade_.stored_energy_J() + previous * crossfade_.crossfade_work_J();
  demand_.obstacle_work_J = previous * crossfade_.obstacle_work_J();
  if (!recentre_pending_ || contact_gain_ > 0.0) return false;
  recentre_pending_ = false;
  contact_muted_ = workspace_.clutched();
  recentre(t.now);
  return true;
}

CalmCondition Renderer::calm_condition(const ContactState& contact, const DeviceSample& sample,
                                       const RenderingCrossfade::FadeLimits& limits) const noexcept {
  CalmCondition c;
  c.proxy_valid = proxy_valid();
  c.sampled = has_sample_time_;
  c.speed_m_per_s = sample.V_BH.linear_m_per_s.norm();
  c.angular_speed_rad_per_s = sample.V_BH.angular_rad_per_s.norm();
  c.force_N = demand_.F_contact.force_N.norm();
  c.torque_Nm = demand_.F_contact.torque_Nm.norm();
  c.max_force_N = kCalmLimitFraction * limits.max_force_N;
  c.max_torque_Nm = kCalmLimitFraction * limits.max_torque_Nm;
  if (!contact.following()) return c;
  const Pose X_WH_at_proxy = contact.X_WQ * inverse(active().X_HT());
  const Vector3d to_proxy_m = (X_WH_at_proxy.translation_m - contact.X_WH.translation_m) / workspace_.scale();
  c.to_proxy_W_m = {to_proxy_m.x(), to_proxy_m.y(), to_proxy_m.z()};
  c.to_proxy_rad = contact.eps.tail<3>().norm();
  return c;
}

void Renderer::forget_device() noexcept {
  crossfade_.reset_law();
  undriven_.reset();
  has_sample_time_ = false;
}

}  // namespace wrenchd
