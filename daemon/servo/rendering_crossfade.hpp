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
/// within kLeastFade_s, and no faster than a force rises after arming. Where the tool fits nowhere in the
/// other scene the force goes to zero so.
///
/// All but exchange() belongs to the servo thread. What is noexcept is RT safe.
class Renderings {
 public:
  static constexpr double kLeastFade_s = 0.100;

  explicit Renderings(std::unique_ptr<Rendering> first) : felt_(std::move(first)) {}
  ~Renderings() = default;

  /// Where others hand over renderings, and destroy those that are done with.
  RenderingExchange& exchange() noexcept { return exchange_; }

  /// The one that is felt; while one takes its place, the one that goes.
  Rendering& felt() noexcept { return *felt_; }
  const Rendering& felt() const noexcept { return *felt_; }
  /// The one that comes; null where none does.
  Rendering* next() noexcept { return next_.get(); }
  const Rendering* next() const noexcept { return next_.get(); }

  enum class News : std::uint8_t {
    none,
    comes,      ///< next() is new, and has to be scaled
    taken_over  ///< felt() is what was next()
  };
  /// Between two ticks. force: whether there is any on the hand; where there is none nothing has to fade.
  News change(bool force) noexcept;

  /// As of Rendering, for both.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  void press(double dt_s) noexcept;

  /// How fast a wrench may go over into another.
  struct Pace {
    double max_force_N, max_torque_Nm;  ///< that may come or go ...
    double over_s;                      ///< ... in so long
  };
  /// What is felt of the wrenches of felt() and of next(), and one step further.
  Wrench mixed(const Wrench& F_felt, const Wrench& F_next, const Pace& pace, double dt_s) noexcept;
  /// The share of next() in it.
  double share() const noexcept { return share_; }
  /// What the springs hold, each by its share [J]; and what the last mixed() put into them by the change
  /// alone.
  double wound_up_J() const noexcept;
  double given_J() const noexcept { return given_J_; }
  /// What obstacles that move put into them in this tick, or took [J].
  double pushed_J() const noexcept;
  bool in_contact() const noexcept;

  /// No time has passed for the laws since nobody knows when.
  void lose_law() noexcept;
  /// What comes takes over at once, and looks for a place anew. True where something came.
  bool lose_place() noexcept;

 private:
  void take_over() noexcept;
  bool fades() const noexcept;

  RenderingExchange exchange_;
  std::unique_ptr<Rendering> felt_;
  std::unique_ptr<Rendering> next_;
  double share_ = 0.0;
  double per_s_ = 0.0;  ///< 0: the fade has not begun
  double given_J_ = 0.0;
};

}  // namespace wrenchd
