// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "daemon/servo/rendering.hpp"
#include "daemon/servo/rendering_exchange.hpp"

namespace wrenchd {

/// The rendering that the hand feels, and for a moment a second one that replaces it.
///
/// The new rendering searches for its proxy near that of the active one, whose wrench stays on the hand
/// meanwhile. When both proxies follow the hand, the wrench moves from the first to the second along a
/// straight line (core/METHOD.md, section 8.6): over kMinFade_s at least, and no faster than force rises
/// after arming. If the tool fits nowhere in the new scene, the wrench fades to zero in the same way.
///
/// Belongs to the servo thread. All members but constructor and destructor are RT-safe.
class RenderingCrossfade {
 public:
  static constexpr double kMinFade_s = 0.100;

  /// first: active from the start. exchange: where other threads offer renderings; it outlives this object.
  /// Not RT-safe: destroys.
  RenderingCrossfade(std::unique_ptr<Rendering> first, RenderingExchange& exchange)
      : exchange_(exchange), active_(std::move(first)) {}
  ~RenderingCrossfade() = default;

  /// The rendering that the hand feels; during a fade, the one that fades out.
  Rendering& active() noexcept { return *active_; }
  const Rendering& active() const noexcept { return *active_; }
  /// The rendering that fades in; null if there is none.
  Rendering* next() noexcept { return next_.get(); }
  const Rendering* next() const noexcept { return next_.get(); }

  enum class Change : std::uint8_t {
    none,
    next_arrived,  ///< next() is new; its stiffness must be scaled.
    switched       ///< active() is what was next() before.
  };
  /// Takes a rendering that is offered, or ends a fade that is complete. driving: force may be on the hand;
  /// if not, a new rendering becomes active at once.
  Change update(bool driving) noexcept;

  /// Rendering::project() of both renderings. Returns false if one of them lost its proxy.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  /// Rendering::compute_wrench() of both renderings.
  void compute_wrench(double dt_s) noexcept;

  /// How fast one wrench may fade into another: a change by a maximum takes rise_time_s.
  struct FadeLimits {
    double max_force_N, max_torque_Nm;
    double rise_time_s;
  };
  /// Blend of the wrenches of active() and next(), after one more step of the fade.
  Wrench blend(const Wrench& F_active, const Wrench& F_next, const FadeLimits& limits, double dt_s) noexcept;
  /// Weight of next() in the blend, 0 to 1.
  double next_weight() const noexcept { return next_weight_; }
  /// Energy that the contact springs hold, blended like the wrenches.
  double stored_energy_J() const noexcept;
  /// Work that the last step of the fade did on the springs.
  double crossfade_work_J() const noexcept { return crossfade_work_J_; }
  /// Work that moving obstacles did on the springs in this tick; negative if they took energy out.
  double obstacle_work_J() const noexcept;
  bool in_contact() const noexcept;

  /// The laws start anew: the time since their last sample is unknown.
  void reset_law() noexcept;
  /// The proxy is unknown and is searched for. next() becomes active at once; returns true if there was one.
  bool invalidate_proxy() noexcept;

 private:
  void switch_to_next() noexcept;
  bool fading() const noexcept;

  RenderingExchange& exchange_;
  std::unique_ptr<Rendering> active_;
  std::unique_ptr<Rendering> next_;
  double next_weight_ = 0.0;
  double weight_rate_per_s_ = 0.0;  ///< Speed of the fade; 0 until it starts.
  double crossfade_work_J_ = 0.0;   ///< Work that the last step of the fade did on the springs.
};

}  // namespace wrenchd
