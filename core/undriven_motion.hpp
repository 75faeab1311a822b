// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/device_profile.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"
#include "core/stability_bound.hpp"

namespace wrenchd {

/// The springs of the contact at one handle pose.
struct SpringState {
  double U_J = 0.0;   ///< potential energy
  Wrench F_B;         ///< minus the gradient of U at fixed obstacles: on the hand, about H, in axes of B
  bool known = true;  ///< false: the potential is not known; undriven motion then waits
};

/// Keeps contact passive on a device that senses motion which no motor drives (core/METHOD.md, section 11.5).
///
/// The rendering uses the handle pose r instead of the measured one. Along driven axes r follows the hand
/// exactly. Along the others it follows only as far as an energy account allows: each change of the potential
/// U(r) by that motion is paid from the account, and each decrease of U by it fills the account. The wrench
/// on the driven axes therefore never gives more work than the hand put in. Without contact r follows freely.
///
/// Frames: B device base, H handle. All members are RT-safe.
class UndrivenMotion {
 public:
  /// sensed, driven: of the device. step: of its encoders; a step of 0 counts as none.
  UndrivenMotion(DofMask sensed, DofMask driven, const EncoderStep& step) noexcept;

  /// False if the device drives all axes that it senses, or none: then the pose passes unchanged.
  bool active() const noexcept { return free_ != kNoDof; }

  /// K_H: bound on the curvature of U, the linearised spring at the handle in axes of H. delay_s: longest
  /// time from a sample to the motors that act on it, half a period of the loop included.
  void set_loop(const Matrix6d& K_H, double delay_s) noexcept;
  /// Share of the requested wrench that reaches the hand, 0 to 1. Energy counts by this share.
  void set_share(double share) noexcept { share_ = share; }

  /// Follows the measured pose X_BH of a new sample, taken at device_time_s. `render(X)` moves the rendering
  /// to handle pose X and returns its SpringState. `undo()` puts the rendering back to where it was before
  /// the last render(), its proxy included: a proxy that returned to the same handle pose by itself could
  /// arrive at another place with more energy. At the end the rendering is at the pose that the function
  /// returns.
  template <class Render, class Undo>
  Pose follow(const Pose& X_BH, double device_time_s, Render&& render, Undo&& undo) noexcept {
    move_driven(X_BH, device_time_s);
    SpringState at = render(X_BH_used_);
    for (int attempt = 0; attempt < 2; ++attempt) {
      const std::optional<Pose> next = propose(at);
      if (!next) break;
      const SpringState there = render(*next);
      if (accept(*next, at, there)) {
        at = there;
        break;
      }
      undo();
      if (!whole_) break;
    }
    finish(at);
    return X_BH_used_;
  }
  /// The same for a rendering whose state depends on the handle pose alone, so that nothing is to be undone.
  template <class Render>
  Pose follow(const Pose& X_BH, double device_time_s, Render&& render) noexcept {
    return follow(X_BH, device_time_s, render, [] {});
  }

  /// Takes the measured pose at once, with an empty account. For a handle that no contact holds.
  void reset(const Pose& X_BH) noexcept;
  void reset() noexcept {
    started_ = false;
    account_J_ = 0.0;
  }

  double account_J() const noexcept { return account_J_; }  ///< energy available to undriven motion
  /// Rotation and translation of the measured handle that the rendering does not follow [rad, m].
  double lag_rad() const noexcept;
  double lag_m() const noexcept;

  /// Content of the account at the begin of each contact: below what an encoder step gives
  /// (kMaxEnergyPerEncoderStep_J), enough for a first step along a contact.
  static constexpr double kInitialAccount_J = 0.1e-6;

 private:
  struct PathPoint {
    double time_s = 0.0;
    Vector6d y = Vector6d::Zero();  ///< driven displacement since the start [m, rad]
  };
  /// A step of r whose change of force has not acted yet.
  struct Pending {
    PathPoint begin;
    Vector6d dF = Vector6d::Zero();  ///< change of the driven wrench
    double reserve_J = 0.0;          ///< taken from the account when the step was made
    double worst_J = 0.0;            ///< largest energy that acting later has given so far
  };
  static constexpr std::size_t kHistory = 64;

  void move_driven(const Pose& X_BH, double device_time_s) noexcept;
  void settle(const PathPoint& now) noexcept;
  std::optional<Pose> propose(const SpringState& at) noexcept;
  bool accept(const Pose& X_BH, const SpringState& from, const SpringState& to) noexcept;
  void finish(const SpringState& at) noexcept;
  Vector6d lag() const noexcept;
  Vector6d affordable(const Vector6d& target, const SpringState& at) const noexcept;
  double late_work_bound_J(const Vector6d& dF) const noexcept;

  DofMask driven_;
  DofMask free_;  ///< axes along which r may differ from the measured pose
  EncoderStep step_;
  Matrix6d K_H_ = Matrix6d::Zero();
  double delay_s_ = 0.0;
  double share_ = 1.0;

  bool started_ = false;
  Pose X_BH_;       ///< measured
  Pose X_BH_used_;  ///< r
  double account_J_ = 0.0;
  bool whole_ = false;  ///< the last proposal was the whole lag
  int wait_ = 0;        ///< ticks until a free handle tries the whole lag again

  std::array<PathPoint, kHistory> path_{};  ///< newest at path_count_ - 1
  std::uint64_t path_count_ = 0;
  std::array<Pending, kHistory> pending_{};
  std::size_t pending_count_ = 0;
};

}  // namespace wrenchd
