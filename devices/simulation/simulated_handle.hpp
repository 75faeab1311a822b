// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"
#include "devices/simulation/hand_path.hpp"

namespace wrenchd {

/// Work done on the handle since the start [J]. Each is force times the way truly moved, so at every moment
///
///   motors_J + hand_J - friction_J = kinetic energy now - kinetic energy at the start
///
/// up to what the integrator itself loses: (h/2m) |net force|^2 of power, h being the substep.
struct SimulatedEnergy {
  double motors_J = 0.0;    ///< > 0: the device pushed the hand
  double hand_J = 0.0;      ///< > 0: the hand moved the handle
  double friction_J = 0.0;  ///< >= 0: lost in the mechanism
};

/// The handle of the simulated device as a rigid body on bearings, in a hand. B = base, H = handle point.
///
///   m dv/dt = F_motors + K (p_G - p) + D (v_G - v) - b v - c v/|v|            and the same in rotation
///
/// The inertia is isotropic about the handle point, so there is no gyroscopic term; gravity is balanced. The
/// hand's torque is K 2 sin(angle/2) about the axis that leads to the goal: within 2 % of K times the angle
/// up to 0.7 rad, smooth and passive beyond.
class SimulatedHandle {
 public:
  /// Throws std::invalid_argument where a mass, friction, stiffness or damping cannot be, or where the hand
  /// is too stiff for the handle's mass at this step. `step_s` is the fixed substep.
  SimulatedHandle(const SimulationSettings& settings, const Pose& X_BH, double step_s);

  /// One substep, semi-implicit: velocities first, friction and damping taken at their end, then the pose.
  /// F_motors: on the hand, about the handle point, in base axes; cut to what the actuators can do. RT safe.
  void step(const HandTarget& target, const Wrench& F_motors) noexcept;
  /// One substep of a handle that is led: it is where the target is, whatever pushes. What that takes of the
  /// hand is in the sums of energy. RT safe.
  void step_prescribed(const HandTarget& target, const Wrench& F_motors) noexcept;
  /// Stops the handle where it is. RT safe.
  void stop() noexcept { V_BH_ = {}; }
  /// Puts the handle there, at rest: an end stop. What it takes is in no sum of energy. RT safe.
  void reset_to(const Pose& X_BH) noexcept {
    X_BH_ = X_BH;
    stop();
  }

  const Pose& X_BH() const noexcept { return X_BH_; }
  const Twist& V_BH() const noexcept { return V_BH_; }
  const Wrench& motor_wrench() const noexcept { return F_motors_; }  ///< really applied in the last substep
  const Wrench& hand_wrench() const noexcept { return F_hand_; }     ///< of the hand on the handle, likewise
  const SimulatedEnergy& energy() const noexcept { return energy_; }
  double kinetic_energy_J() const noexcept;

 private:
  /// One of the two halves of the motion: translation or rotation.
  struct MotionParameters {
    double inertia;         ///< [kg] or [kg m^2]
    double hand_stiffness;  ///< [N/m] or [N.m/rad]
    double hand_damping;    ///< per second of it
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
