// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/clock.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// A simple model of the environment near the handle, sent by a client. The loop evaluates it at full rate
/// until it expires. Frames: W world, H handle, A anchor of a spring.
struct LocalModel {
  enum class Kind : std::uint8_t {
    plane,    ///< Half-space for the handle point: solid where normal_W . x < offset_m.
    spring,   ///< Spring with its equilibrium pose at X_WA.
    damping,  ///< Viscous field in the whole workspace.
  };
  static constexpr double kMaxLifetime_s = 10.0;  ///< Longest time from one update to the expiry.

  std::uint32_t id = 0;  ///< Number of the model. A new model with the same id replaces the old one.
  Kind kind = Kind::damping;
  Vector3d normal_W = Vector3d::UnitZ();  ///< Unit normal of a plane, away from the solid.
  double offset_m = 0.0;                  ///< Distance of a plane from the world origin along normal_W.
  Pose X_WA;                              ///< Equilibrium pose of the handle for a spring.
  double stiffness_N_per_m = 0.0;         ///< Stiffness of a plane or a spring.
  double stiffness_Nm_per_rad = 0.0;      ///< Angular stiffness of a spring.
  double damping_N_s_per_m = 0.0;         ///< Damping of the handle's velocity.
  double damping_Nm_s_per_rad = 0.0;      ///< Damping of the handle's angular velocity.
  TimePoint expires{};                    ///< Time at which the fade to zero is complete.
};

/// The set of all models that are requested at one time.
inline constexpr std::size_t kMaxLocalModels = 8;
using LocalModelSet = StaticVector<LocalModel, kMaxLocalModels>;

/// Evaluates the local models in the servo thread, METHOD (70). A new model fades in and a removed or expired
/// model fades out over kFade_s. A model that replaces another of the same kind is approached exponentially
/// with a quarter of kFade_s as time constant. So the wrench never jumps, also if the client dies.
/// Every model is a spring or a damper, and therefore passive.
class LocalModels {
 public:
  static constexpr double kFade_s = 0.050;

  /// Replaces the set of requested models. Models that are no longer in the set fade out. RT-safe.
  void set_models(const LocalModelSet& models) noexcept;

  /// Result of one evaluation.
  struct Evaluation {
    Wrench F_H_W;                   ///< Wrench on the handle, about the handle point, in axes of W.
    double stored_energy_J = 0.0;   ///< Energy stored in all springs.
    double crossfade_work_J = 0.0;  ///< Change of stored energy by fading and parameter changes in this tick.
    bool any_active = false;        ///< True if at least one model has or gets a weight above zero.
  };
  /// Advances all fades by dt_s and returns the sum of all models at handle pose X_WH. V_H_W: twist of the
  /// handle point in axes of W. scale: factor on stiffness and damping, 0 to 1. RT-safe.
  Evaluation evaluate(const Pose& X_WH, const Twist& V_H_W, TimePoint now, double dt_s,
                      double scale) noexcept;

  /// Sums of the gains of all active models. The stability analysis derives the scale from them.
  struct TotalGains {
    double stiffness_N_per_m = 0.0, stiffness_Nm_per_rad = 0.0;
    double damping_N_s_per_m = 0.0, damping_Nm_s_per_rad = 0.0;
  };
  /// Returns the sums over all models that are requested or still fade out. RT-safe.
  TotalGains total_gains() const noexcept;

  /// Removes all models at once, without a fade. RT-safe.
  void clear() noexcept;

 private:
  struct Slot {
    LocalModel target;       ///< Parameters that the client sent last.
    LocalModel current;      ///< Parameters in use, which approach `target`.
    double weight = 0.0;     ///< Factor on the wrench, 0 to 1.
    bool requested = false;  ///< True while the model is in the set; then weight rises, otherwise it falls.
  };
  /// Eight requested models, and eight that fade out.
  std::array<Slot, 16> slots_{};
};

}  // namespace wrenchd
