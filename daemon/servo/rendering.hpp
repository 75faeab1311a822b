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
            std::shared_ptr<const Scene> scene, std::shared_ptr<ProxyInitializer> placer);

  /// Goes once through what the ticks will use, near this pose of the handle, so that no memory is touched
  /// and no code is fetched there for the first time. Milliseconds. Not RT safe.
  void warm_up(const Pose& X_WH, double scene_time_s);

  /// One tick: p from the pose of the handle, and its projection q, which follows p from last tick's as a
  /// proxy; where there is no place to follow from, that is looked for. False where it was caught between
  /// obstacles that move: then its place is lost.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  /// The body wrench of last project(). dt_s: of the device's clock since the last call.
  void compute_wrench(double dt_s) noexcept;

  /// Nothing is known of q: no contact, no wrench, and a place is looked for from the next tick on.
  void invalidate_proxy() noexcept;
  /// The law begins anew: nobody knows how much time has passed.
  void reset_law() noexcept { law_.reset(); }
  /// Where to look for it: near this pose of the tool instead of p, until it is found. For a tool that has
  /// to be on the side of a wall on which another rendering has it.
  void initialize_near(const Pose& X_WT) noexcept;
  bool proxy_valid() const noexcept {
    return proxy_initialization_ == ProxyInitialization::complete ||
           proxy_initialization_ == ProxyInitialization::found;
  }
  ProxyInitialization proxy_initialization() const noexcept { return proxy_initialization_; }

  /// As much of the spring and the damper it was made with.
  void set_stiffness_scale(const StiffnessScale& share) noexcept;

  const Pose& X_WP() const noexcept { return X_WP_; }
  const Pose& X_WQ() const noexcept { return X_WQ_; }  ///< means nothing unless proxy_valid()
  const Penetration& depth() const noexcept { return depth_; }
  bool in_contact() const noexcept { return depth_.contacts > 0; }
  Touches contacts() const noexcept;
  const Wrench& F_T() const noexcept { return F_T_; }  ///< body frame
  /// What the spring holds now: half of force times way, and of torque times turn [J].
  double stored_energy_J() const noexcept;
  /// What obstacles that move put into it in this tick, and not the hand; below 0 where they took it [J].
  double obstacle_work_J() const noexcept;

  std::uint32_t id() const noexcept { return id_; }
  const Scene& scene() const noexcept { return *scene_; }
  const Pose& X_HT() const noexcept { return X_HT_; }
  const StabilityAnalysis& stability() const noexcept { return stability_; }

  /// Of all that it was made with and that no tick may change: what a tick computes from has to have the sum
  /// that it was handed over with.
  std::uint64_t checksum() const noexcept;

 private:
  void initialize_proxy(TimePoint now, double scene_time_s) noexcept;

  // Constant after construction
  std::uint32_t id_;
  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<ProxyInitializer> proxy_initializer_;
  Pose X_HT_;
  Inertia M_;
  SpringLaw spring_law_;
  double energy_stiffness_per_s2_;
  WrenchGains gains_;
  StabilityAnalysis stability_;

  PenetrationDepth penetration_;
  WrenchLaw law_;
  double spring_scale_ = 1.0;

  ProxyInitialization proxy_initialization_ = ProxyInitialization::searching;
  Pose X_WQ_;
  Pose X_WP_;
  Penetration depth_;
  Wrench F_T_;
  double scene_time_s_ = 0.0;         ///< of depth_
  double obstacle_work_kg_m2_ = 0.0;  ///< of what obstacles moved since the tick before [kg m^2]
  bool has_initial_guess_ = false;
  Pose X_WT_guess_;
  bool starts_in_contact_ = false;  ///< pressed, and not at its first touch: what it comes with is no speed
  std::uint32_t request_id_ = 0;    ///< number of the last one to the placer
  bool request_pending_ = false;    ///< and it is not answered yet
  TimePoint retry_at_{};            ///< not before then
};

}  // namespace wrenchd
