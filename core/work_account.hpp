// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/pose.hpp"
#include "core/spatial.hpp"
#include "core/stability_bound.hpp"

namespace wrenchd {

/// Properties of the servo loop that a WorkAccount needs.
struct WorkAccountLoop {
  std::size_t delay_ticks = 4;  ///< number of ticks for which a wrench may still act after it was sent
  EncoderStep step = {};        ///< step of the device's encoders; 0: the profile states none
};

/// Bounds the work that an external wrench does on the hand: by the energy that its source has declared, and
/// by the work that the hand has done against the wrench before. core/METHOD.md, section 16.
///
/// The balance is never below zero as long as the handle accelerates by no more than
/// kMaxAcceleration_m_per_s2 and kMaxAcceleration_rad_per_s2, whatever its source requests. Wrenches are on
/// the hand, about the handle point H, in axes of the device base B. RT-safe.
class WorkAccount {
 public:
  /// Most energy that the account holds [J].
  static constexpr double kMaxBalance_J = 1.0;
  static constexpr double kMaxAcceleration_m_per_s2 = 200.0;
  static constexpr double kMaxAcceleration_rad_per_s2 = 4000.0;
  static constexpr std::size_t kMaxDelay_ticks = 48;

  /// A longer delay than kMaxDelay_ticks counts as kMaxDelay_ticks.
  explicit WorkAccount(const WorkAccountLoop& loop = {}) noexcept;

  /// The source declares energy [J]. Nothing is added for a value that is not positive or not finite.
  void deposit(double energy_J) noexcept;

  /// Takes the work since the previous sample from the balance. Returns the part of the requested wrench that
  /// the balance allows, in the same direction. X_BH: newest sample. sample_dt_s: device time since the
  /// sample of the previous call; 0 for the same sample. tick_s: period of the loop. Returns zero if any
  /// input is not finite.
  Wrench permit(const Wrench& requested_B, const Pose& X_BH, double sample_dt_s, double tick_s) noexcept;

  /// Records the wrench that was sent in this tick. Without this call the account assumes that the result of
  /// permit() was sent.
  void record_sent(const Wrench& sent_B) noexcept;

  /// The wrench has ended: what is left of the balance is lost, as soon as no wrench is under way. Call it in
  /// each tick without a wrench. A debt stays.
  void close() noexcept;
  /// The device is another one: forgets samples, wrenches and balance.
  void reset() noexcept;

  /// Energy that the wrench may still give to the hand [J].
  double balance_J() const noexcept { return balance_J_; }

 private:
  static constexpr std::size_t kHistory = 64;

  struct Motion {
    Vector3d displacement_m = Vector3d::Zero();
    Vector3d rotation_rad = Vector3d::Zero();
  };
  const Wrench& sent(std::size_t ticks_ago) const noexcept { return sent_[(tick_ - ticks_ago) % kHistory]; }
  /// Number of wrenches that may have acted since the previous sample.
  std::size_t window() const noexcept;
  double work_bound_J(const Motion& step) const noexcept;
  double reserve_J(const Wrench& F, double tick_s) const noexcept;

  WorkAccountLoop loop_;
  double balance_J_ = 0.0;
  std::array<Wrench, kHistory> sent_{};  ///< wrench of each tick, newest at tick_
  std::uint64_t tick_ = kHistory;
  std::size_t ticks_since_sample_ = 0;  ///< ticks since the last new sample
  bool has_pose_ = false;
  Pose X_BH_;
  double speed_m_per_s_ = 0.0, speed_rad_per_s_ = 0.0;  ///< between the last two samples
};

}  // namespace wrenchd
