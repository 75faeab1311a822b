// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "daemon/servo/rendering.hpp"
#include "daemon/servo/rendering_exchange.hpp"

namespace wrenchd {

/// What the hand feels: one rendering, and for a moment two, while another takes its place.
///
/// The other one looks for its place beside, near the proxy of the first, which is felt as before. When it
/// has one both follow the hand, and the wrench goes over from the first to the second along a straight line:
/// within kMinFade_s, and no faster than a force rises after arming. Where the tool fits nowhere in the
/// other scene the force goes to zero so.
///
/// All but exchange() belongs to the servo thread. What is noexcept is RT safe.
class RenderingCrossfade {
 public:
  static constexpr double kMinFade_s = 0.100;

  explicit RenderingCrossfade(std::unique_ptr<Rendering> first) : active_(std::move(first)) {}
  ~RenderingCrossfade() = default;

  /// Where others hand over renderings, and destroy those that are done with.
  RenderingExchange& exchange() noexcept { return exchange_; }

  /// The one that is felt; while one takes its place, the one that goes.
  Rendering& active() noexcept { return *active_; }
  const Rendering& active() const noexcept { return *active_; }
  /// The one that comes; null where none does.
  Rendering* next() noexcept { return next_.get(); }
  const Rendering* next() const noexcept { return next_.get(); }

  enum class Change : std::uint8_t {
    none,
    next_arrived,  ///< next() is new, and has to be scaled
    switched       ///< felt() is what was next()
  };
  /// Between two ticks. force: whether there is any on the hand; where there is none nothing has to fade.
  Change update(bool force) noexcept;

  /// As of Rendering, for both.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  void compute_wrench(double dt_s) noexcept;

  /// How fast a wrench may go over into another.
  struct FadeLimits {
    double max_force_N, max_torque_Nm;  ///< that may come or go ...
    double rise_time_s;                 ///< ... in so long
  };
  /// What is felt of the wrenches of felt() and of next(), and one step further.
  Wrench blend(const Wrench& F_felt, const Wrench& F_next, const FadeLimits& pace, double dt_s) noexcept;
  /// The share of next() in it.
  double next_weight() const noexcept { return next_weight_; }
  /// What the springs hold, each by its share [J]; and what the last mixed() put into them by the change
  /// alone.
  double stored_energy_J() const noexcept;
  double crossfade_work_J() const noexcept { return crossfade_work_J_; }
  /// What obstacles that move put into them in this tick, or took [J].
  double obstacle_work_J() const noexcept;
  bool in_contact() const noexcept;

  /// No time has passed for the laws since nobody knows when.
  void reset_law() noexcept;
  /// What comes takes over at once, and looks for a place anew. True where something came.
  bool invalidate_proxy() noexcept;

 private:
  void switch_to_next() noexcept;
  bool fading() const noexcept;

  RenderingExchange exchange_;
  std::unique_ptr<Rendering> active_;
  std::unique_ptr<Rendering> next_;
  double next_weight_ = 0.0;
  double weight_rate_per_s_ = 0.0;  ///< 0: the fade has not begun
  double crossfade_work_J_ = 0.0;
};

}  // namespace wrenchd
