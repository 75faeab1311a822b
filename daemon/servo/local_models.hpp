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

/// What a client knows of the surroundings of the handle, for as long as it goes on saying so. It is felt at
/// the rate of the loop, whatever the client's is. W = world, H = handle point.
struct LocalModel {
  enum class Kind : std::uint8_t {
    plane,    ///< a wall for the handle point: solid where normal_W . x < offset_m
    spring,   ///< to X_WF
    damping,  ///< a field that brakes, everywhere
  };
  static constexpr double kMaxLifetime_s = 10.0;  ///< from word to word

  std::uint32_t id = 0;  ///< a new one of the same id takes the place of the last
  Kind kind = Kind::damping;
  Vector3d normal_W = Vector3d::UnitZ();
  double offset_m = 0.0;
  Pose X_WA;
  double stiffness_N_per_m = 0.0;
  double stiffness_Nm_per_rad = 0.0;  ///< of a spring
  double damping_N_s_per_m = 0.0;
  double damping_Nm_s_per_rad = 0.0;
  TimePoint expires{};  ///< it fades to nothing by then
};

/// All that are known.
inline constexpr std::size_t kMaxLocalModels = 8;
using LocalModelSet = StaticVector<LocalModel, kMaxLocalModels>;

/// The local models, as the servo thread feels them. Each comes and goes over kFade_s, and one that is
/// replaced by another of its kind goes over into it as fast, so that nothing changes at once, least of all
/// when a client dies. All of them are springs at rest somewhere and brakes: what is not is not to be had. RT
/// safe.
class LocalModels {
 public:
  static constexpr double kFade_s = 0.050;

  /// These are all; what was there before and is not among them fades out.
  void set_models(const LocalModelSet& models) noexcept;

  /// What they ask for, and one step further. V_H_W: of the handle point, in W. share: of their stiffness and
  /// damping that the device bears.
  struct Evaluation {
    Wrench F_H_W;                   ///< about the handle point, in W
    double stored_energy_J = 0.0;   ///< what their springs hold
    double crossfade_work_J = 0.0;  ///< and what of that they were given by coming, and not by the hand
    bool any_active = false;
  };
  Evaluation evaluate(const Pose& X_WH, const Twist& V_H_W, TimePoint now, double dt_s,
                      double share) noexcept;

  /// The sums over all that is felt at the moment: what share of it the device bears is a matter of these.
  struct TotalGains {
    double stiffness_N_per_m = 0.0, stiffness_Nm_per_rad = 0.0;
    double damping_N_s_per_m = 0.0, damping_Nm_s_per_rad = 0.0;
  };
  TotalGains total_gains() const noexcept;

  /// None is felt any more.
  void clear() noexcept;

 private:
  struct Slot {
    LocalModel target;    ///< as it was told
    LocalModel current;   ///< as it is felt, on its way there
    double weight = 0.0;  ///< of it that is felt
    bool requested = false;
  };
  std::array<Slot, 16> slots_{};
};

}  // namespace wrenchd
