// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "collision/touch.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/wrench_law.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/stability_analysis.hpp"

namespace wrenchd {

/// What the tool touches, and how that feels: a scene, the proxy that follows the hand in it, and the law
/// that makes a wrench of the two. Lines 2 to 7 of Algorithm 1.
///
/// Made by any thread, which takes its time; then it belongs to the servo thread until that gives it back.
/// Frames as in ServoLoop. What is noexcept here is RT safe.
class Rendering {
 public:
  /// number: which one this is, for records; 0 is that of the start. Throws std::invalid_argument where the
  /// method cannot work with the scene, or the gains make no spring.
  Rendering(std::uint32_t number, const Settings& settings, const DeviceProfile& profile,
            std::shared_ptr<const Scene> scene, std::shared_ptr<Placer> placer);

  /// Goes once through what the ticks will use, near this pose of the handle, so that no memory is touched
  /// and no code is fetched there for the first time. Milliseconds. Not RT safe.
  void warm_up(const Pose& X_WH, double scene_time_s);

  /// One tick: p from the pose of the handle, and its projection q, which follows p from last tick's as a
  /// proxy; where there is no place to follow from, that is looked for. False where it was caught between
  /// obstacles that move: then its place is lost.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  /// The body wrench of last project(). dt_s: of the device's clock since the last call.
  void press(double dt_s) noexcept;

  /// Nothing is known of q: no contact, no wrench, and a place is looked for from the next tick on.
  void lose_place() noexcept;
  /// The law begins anew: nobody knows how much time has passed.
  void lose_law() noexcept { law_.reset(); }
  /// Where to look for it: near this pose of the tool instead of p, until it is found. For a tool that has
  /// to be on the side of a wall on which another rendering has it.
  void seek_near(const Pose& X_WT) noexcept;
  bool has_place() const noexcept { return placing_ == Placing::following || placing_ == Placing::placed; }
  Placing placing() const noexcept { return placing_; }

  /// As much of the spring and the damper it was made with.
  void scale(const StiffnessShare& share) noexcept;

  const Pose& X_WP() const noexcept { return X_WP_; }
  const Pose& X_WQ() const noexcept { return X_WQ_; }  ///< means nothing unless has_place()
  const Penetration& depth() const noexcept { return depth_; }
  bool in_contact() const noexcept { return depth_.contacts > 0; }
  Touches touches() const noexcept;
  const Wrench& F_T() const noexcept { return F_T_; }  ///< body frame
  /// What the spring holds now: half of force times way, and of torque times turn [J].
  double wound_up_J() const noexcept;
  /// What obstacles that move put into it in this tick, and not the hand; below 0 where they took it [J].
  double pushed_J() const noexcept;

  std::uint32_t number() const noexcept { return number_; }
  const Scene& scene() const noexcept { return *scene_; }
  const Pose& X_HT() const noexcept { return X_HT_; }
  const Stability& stability() const noexcept { return stability_; }

  /// Of all that it was made with and that no tick may change: what a tick computes from has to have the sum
  /// that it was handed over with.
  std::uint64_t sum() const noexcept;

 private:
  void place(TimePoint now, double scene_time_s) noexcept;

  // Constant after construction
  std::uint32_t number_;
  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<Placer> placer_;
  Pose X_HT_;
  Inertia M_;
  SpringLaw spring_;
  double energy_stiffness_per_s2_;
  WrenchGains gains_;
  Stability stability_;

  PenetrationDepth penetration_;
  WrenchLaw law_;
  double spring_share_ = 1.0;

  Placing placing_ = Placing::seeking;
  Pose X_WQ_;
  Pose X_WP_;
  Penetration depth_;
  Wrench F_T_;
  double scene_time_s_ = 0.0;  ///< of depth_
  double pushed_T_ = 0.0;      ///< of what obstacles moved since the tick before [kg m^2]
  bool seeks_near_ = false;
  Pose X_near_;
  bool begins_ = false;         ///< pressed, and not at its first touch: what it comes with is no speed
  std::uint32_t question_ = 0;  ///< number of the last one to the placer
  bool asked_ = false;          ///< and it is not answered yet
  TimePoint ask_again_{};       ///< not before then
};

}  // namespace wrenchd
