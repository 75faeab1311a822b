// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "daemon/servo/rendering.hpp"
#include "daemon/servo/rendering_exchange.hpp"

namespace wrenchd {

/// Holds the active rendering and, during a change, the next one, and cross-fades the wrench between the two.
///
/// The proxy of the next rendering is initialised near the active proxy while the active rendering continues.
/// When the next proxy is complete, the weight of the next wrench rises linearly from 0 to 1 (METHOD (71)).
/// If the search finds no feasible pose, the wrench fades to zero. The fade takes at least kMinFade_s and is
/// no faster than the force rise after arming. daemon/servo/README.md, section "Renderings".
///
/// Belongs to the servo thread. All members except constructor and destructor are RT-safe.
class RenderingCrossfade {
 public:
  static constexpr double kMinFade_s = 0.100;

  /// first: active from the start. exchange: where another thread offers renderings; it must outlive this
  /// object. Not RT-safe: for set-up.
  RenderingCrossfade(std::unique_ptr<Rendering> first, RenderingExchange& exchange)
      : exchange_(exchange), active_(std::move(first)) {}
  /// Destroys both renderings. Not RT-safe: frees memory.
  ~RenderingCrossfade() = default;

  /// Returns the active rendering. During a cross-fade this is the outgoing one.
  Rendering& active() noexcept { return *active_; }
  const Rendering& active() const noexcept { return *active_; }
  /// Returns the incoming rendering; null if no change is under way.
  Rendering* next() noexcept { return next_.get(); }
  const Rendering* next() const noexcept { return next_.get(); }

  enum class Change : std::uint8_t {
    none,
    next_arrived,  ///< next() is new. The caller must set its stiffness scale.
    switched       ///< The former next() is now active().
  };
  /// Takes an offered rendering and completes a finished cross-fade. driving: true if force may act on the
  /// hand; otherwise the change is immediate. Call once per tick, before project().
  Change update(bool driving) noexcept;

  /// Calls Rendering::project() for both renderings. Returns false if either proxy is trapped.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  /// Moves p of this tick to another handle pose in both renderings. Returns false if a proxy is trapped.
  bool move(const Pose& X_WH) noexcept;
  /// Undoes the last move() of both renderings. RT-safe.
  void undo_move() noexcept;
  /// Calls Rendering::compute_wrench() for both renderings.
  void compute_wrench(double dt_s) noexcept;

  /// Bounds the rate of the cross-fade: a change of max_force_N or max_torque_Nm takes rise_time_s.
  struct FadeLimits {
    double max_force_N;
    double max_torque_Nm;
    double rise_time_s;
  };
  /// Advances the weight by dt_s and returns (1 - w) F_active + w F_next.
  Wrench blend(const Wrench& F_active, const Wrench& F_next, const FadeLimits& limits, double dt_s) noexcept;
  /// Returns w, the weight of next() in the blend, 0 to 1.
  double next_weight() const noexcept { return next_weight_; }
  /// Returns the weighted sum of the energies stored in the springs [J].
  double stored_energy_J() const noexcept;
  /// Returns the change of stored energy that the weight change of the last blend() caused [J].
  double crossfade_work_J() const noexcept { return crossfade_work_J_; }
  /// Returns the weighted sum of the work of moving obstacles in this tick [J].
  double obstacle_work_J() const noexcept;
  /// Returns true if a rendering with a weight above zero is in contact.
  bool in_contact() const noexcept;

  /// Resets the wrench laws of both renderings, for use after a gap of unknown length.
  void reset_law() noexcept;
  /// Ends a cross-fade at once, then invalidates the proxy of the active rendering. Returns true if the
  /// active rendering changed.
  bool invalidate_proxy() noexcept;

 private:
  void switch_to_next() noexcept;
  bool fading() const noexcept;

  RenderingExchange& exchange_;
  std::unique_ptr<Rendering> active_;
  std::unique_ptr<Rendering> next_;
  double next_weight_ = 0.0;
  double weight_rate_per_s_ = 0.0;  ///< Rate of next_weight_; 0 until the cross-fade begins.
  double crossfade_work_J_ = 0.0;
};

}  // namespace wrenchd
