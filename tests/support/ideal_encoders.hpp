// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/simulation_settings.hpp"

namespace wrenchd::test {

/// Settings of a simulated device whose poses are not rounded to encoder steps.
inline SimulationSettings ideal_encoders() {
  SimulationSettings settings;
  settings.position_quantum_m = 0.0;
  settings.rotation_quantum_rad = 0.0;
  return settings;
}

}  // namespace wrenchd::test
