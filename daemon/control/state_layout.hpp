// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include <nlohmann/json_fwd.hpp>

#include "daemon/control/reconfigurator.hpp"
#include "daemon/servo/shared_state.hpp"

namespace wrenchd {

/// Returns the layout of the shared memory: offset, type, unit, frame, meaning and value names of every
/// field, and the names of the obstacles in one rendering. Not RT-safe: allocates.
nlohmann::json state_layout(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles);

/// Sends a result together with a file descriptor.
using SendWithDescriptor = std::function<void(const nlohmann::json& result, int descriptor)>;

/// The method `state.open`. Sends {"layout": ...}, with the descriptor of the memory as ancillary data
/// (SCM_RIGHTS) of the first byte. Not RT-safe: allocates.
void open_state(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles,
                const SendWithDescriptor& send);

}  // namespace wrenchd
