// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/gravity_compensation.hpp"
#include "core/undriven_motion.hpp"
#include "daemon/servo/demand.hpp"
#include "daemon/servo/device_port.hpp"
#include "daemon/servo/event.hpp"
#include "daemon/servo/external_wrench.hpp"
#include "daemon/servo/local_models.hpp"
#include "daemon/servo/rendering_crossfade.hpp"
#include "daemon/servo/request_inbox.hpp"
#include "daemon/servo/stability_monitor.hpp"
#include "daemon/servo/tick_clock.hpp"
#include "daemon/servo/verdict.hpp"
#include "daemon/servo/workspace.hpp"

namespace wrenchd {

/// Everything virtual that the hand touches: the workspace that maps the handle into the world, the
/// renderings, the local models and the weight compensation. Computes proxy and wrench, Algorithm 1 of the
/// paper, lines 2 to 7.
///
/// Frames: W world, B device base, H handle point, T body frame of the tool, P commanded pose p, Q proxy pose
/// q. All members but the constructor are RT-safe.
class Renderer {
 public:
  /// rendering: active first. exchange: where others are offered; it and events outlive the renderer. Not
  /// RT-safe: allocates.
  Renderer(const Settings& settings, const DeviceProfile& profile, std::unique_ptr<Rendering> rendering,
           RenderingExchange& exchange, EventQueue& events);

  /// Makes the changes that were requested, and those that the verdict and the buttons bring. A change of
  /// scene or workspace fades over many ticks while force is on the hand; otherwise it is made at once.
  /// Returns the number of changes since the start.
  std::uint32_t apply(const Requests& requests, const Verdict& verdict, const DeviceReading& reading,
                      const TickTime& t) noexcept;
  /// Derives the stiffness that stays passive from the measured loop, and scales the renderings to it.
  /// Returns the energy bounds for the measured delay.
  EnergyBounds derive_stiffness(const TickTime& t) noexcept;

  /// p from the sample, and its projection q, which follows p from the previous tick's as a proxy. Without a
  /// usable sample the contact stays as it was. sent_share: share of the last contact wrench that was sent.
  ContactState project(const DeviceSample& sample, const Verdict& verdict, double sent_share,
                       const TickTime& t) noexcept;
  /// The wrench of the contact, Eq. (16) or the energy law, as the device takes it.
  Demand compute_wrench(const ContactState& contact, const DeviceSample& sample, const Verdict& verdict,
                        const RenderingCrossfade::FadeLimits& limits, const TickTime& t) noexcept;

  /// In a world of two hands: takes the tool of a hand without a device out of it.
  void leave_shared_world() noexcept { crossfade_.active().leave_shared_world(); }
  /// The next device may be another, with another clock: resets the wrench laws.
  void forget_device() noexcept;

  /// The active rendering.
  const Rendering& active() const noexcept { return crossfade_.active(); }
  bool proxy_valid() const noexcept { return active().proxy_valid(); }
  /// What the last tick demanded, with the contact as it is now.
  Demand current_demand() const noexcept;
  /// Number of changes made on request since the start.
  std::uint32_t change_count() const noexcept { return change_count_; }
  /// Share of the configured stiffness that stays passive.
  const StiffnessScale& stiffness_scale() const noexcept { return stability_.scale(); }
  EnergyBounds energy_bounds() const noexcept { return stability_.energy_bounds(); }

 private:
  bool follow_driven(const DeviceSample& sample, double sent_share, const TickTime& t) noexcept;
  SpringState spring_state() const noexcept;
  Wrench on_hand(const Rendering& rendering, const Wrench& F_T) const noexcept;
  void change_rendering(bool driving, const TickTime& t) noexcept;
  void change_workspace(const WorkspaceRequest& request) noexcept;
  void handle_buttons(std::uint32_t buttons, TimePoint now) noexcept;
  void recentre(TimePoint now) noexcept;
  void update_grasp(CommandSet commands) noexcept;
  void report_grasp(TimePoint now) noexcept;
  bool update_contact_gain(const TickTime& t) noexcept;
  bool compute_demand(const DeviceSample& sample, const RenderingCrossfade::FadeLimits& limits,
                      const TickTime& t) noexcept;
  Wrench contact_wrench(const Rendering& rendering) const noexcept;
  void advance_external_wrench(const TickTime& t) noexcept;
  Wrench local_model_wrench(const DeviceSample& sample, const TickTime& t) noexcept;
  CalmCondition calm_condition(const ContactState& contact, const DeviceSample& sample,
                               const RenderingCrossfade::FadeLimits& limits) const noexcept;
  void invalidate_proxy(TimePoint now) noexcept;
  void adopt_rendering(TimePoint now) noexcept;
  void scale_renderings() noexcept;
  void report_scale(TimePoint now) noexcept;
  ContactState contact() const noexcept;
  std::optional<Pose> held_pose() const noexcept;

  EventQueue& events_;
  WrenchPoint wrench_point_;
  DofMask driven_;
  std::uint32_t grasp_button_;     ///< Bit of the button that holds a free body; 0 if there is none.
  std::uint32_t recentre_button_;  ///< Bit of the button that recentres the workspace; 0 if there is none.

  RenderingCrossfade crossfade_;
  Workspace workspace_;
  LocalModels local_models_;
  ExternalWrench external_wrench_;
  double local_model_scale_ = 1.0;  ///< Share of the stiffness of the local models that stays passive.
  GravityCompensation gravity_;
  StabilityMonitor stability_;
  UndrivenMotion undriven_;

  double contact_gain_ = 1.0;   ///< Share of the contact wrench that goes out.
  bool contact_muted_ = false;  ///< True while the contact gain ramps down to 0; otherwise it ramps up to 1.
  bool recentre_pending_ = false;     ///< The workspace is recentred when the contact gain has reached 0.
  std::uint32_t recentre_count_ = 0;  ///< Last WorkspaceRequest::recentre_count.
  std::uint32_t buttons_ = 0;         ///< Buttons in the previous tick.
  bool grasp_wanted_ = false;         ///< The tool holds the body that it touches.
  std::uint32_t held_body_ = 0;       ///< Body of the last event about a grasp; 0 if the tool let go.
  std::uint32_t change_count_ = 0;    ///< Changes made on request since the start.
  double reported_scale_ = 1.0;       ///< Share of the stiffness in the last event about it.
  double sample_time_s_ = 0.0;        ///< Device time of the last usable sample.
  bool has_sample_time_ = false;      ///< False until the first usable sample of a device.
  Demand demand_;                     ///< Demand of the last tick with a usable sample.
};

}  // namespace wrenchd
