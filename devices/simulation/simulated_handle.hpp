// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"
#include "devices/simulation/hand_path.hpp"

namespace wrenchd {

/// Work done on the handle since the start [J]: force times actual displacement. At each time
///
///   motors_J + hand_J - friction_J = present kinetic energy - initial kinetic energy
///
/// except for the loss of the integrator, whose power is (h/2m) |net force|^2 with the substep h.
struct SimulatedEnergy {
  double motors_J = 0.0;    ///< > 0: the motors did work on the hand
  double hand_J = 0.0;      ///< > 0: the hand did work on the handle
  double friction_J = 0.0;  ///< >= 0: dissipated in the mechanism
};

/// Handle of the simulated device: a rigid body on bearings, held by a hand. B = base, H = handle frame.
///
///   m dv/dt = F_motors + K (p_G - p) + D (v_G - v) - b v - c v/|v|            and the same in rotation
///
/// The inertia is isotropic about the handle point, so there is no gyroscopic term. Gravity is balanced. The
/// torque of the hand is K 2 sin(angle/2) about the axis to the goal. Up to 0.7 rad it is within 2 % of K
/// times the angle; beyond, it remains smooth and passive.
class SimulatedHandle {
 public:
  /// `step_s`: fixed substep. Throws std::invalid_argument if a mass, friction, stiffness or damping is
  /// invalid, or if the hand is too stiff for the mass of the handle at this step. Not RT-safe: allocates on
  /// errors.
  SimulatedHandle(const SimulationSettings& settings, const Pose& X_BH, double step_s);

  /// Advances one semi-implicit substep: first the velocities, with friction and damping at the end of the
  /// step, then the pose. F_motors: on the hand, about the handle point, in B; clamped to the actuator
  /// limits. RT-safe.
  void step(const HandTarget& target, const Wrench& F_motors) noexcept;
  /// Advances one substep of a handle with prescribed motion: it takes the pose of the target, whatever the
  /// forces are. The energy sums include the work of the hand. RT-safe.
  void step_prescribed(const HandTarget& target, const Wrench& F_motors) noexcept;
  /// Stops the handle at its pose. RT-safe.
  void stop() noexcept { V_BH_ = {}; }
  /// Sets the pose, at rest, as at an end stop. The energy sums do not include the lost energy. RT-safe.
  void reset_to(const Pose& X_BH) noexcept {
    X_BH_ = X_BH;
    stop();
  }

  const Pose& X_BH() const noexcept { return X_BH_; }
  const Twist& V_BH() const noexcept { return V_BH_; }
  /// Wrench applied in the last substep, after the actuator limits.
  const Wrench& motor_wrench() const noexcept { return F_motors_; }
  /// Wrench of the hand on the handle in the last substep.
  const Wrench& hand_wrench() const noexcept { return F_hand_; }
  const SimulatedEnergy& energy() const noexcept { return energy_; }
  double kinetic_energy_J() const noexcept;

 private:
  /// Parameters of translation or of rotation.
  struct MotionParameters {
    double inertia;         ///< [kg] or [kg m^2]
    double hand_stiffness;  ///< [N/m] or [N.m/rad]
    double hand_damping;    ///< [N.s/m] or [N.m.s/rad]
    double viscous_friction;
    double coulomb_friction;  ///< [N] or [N.m]
    double actuator_max;      ///< [N] or [N.m]
  };
  struct AppliedForces {
    Vector3d motors;
    Vector3d hand;
  };
  AppliedForces integrate(const MotionParameters& motion, const Vector3d& demand, const Vector3d& offset,
                          const Vector3d& goal_velocity, Vector3d& velocity) noexcept;

  MotionParameters translation_;
  MotionParameters rotation_;
  double step_s_;
  Pose X_BH_;
  Twist V_BH_;
  Wrench F_motors_;
  Wrench F_hand_;
  SimulatedEnergy energy_;
};

}  // namespace wrenchd
