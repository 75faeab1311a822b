// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include <nlohmann/json_fwd.hpp>

#include "daemon/control/reconfigurator.hpp"
#include "daemon/servo/shared_state.hpp"

namespace wrenchd {

/// What a program has to know to read the shared memory: every field with its place, type, unit, frame,
/// names of its values and meaning. The obstacles' names are those of one rendering. Not RT safe.
nlohmann::json state_layout(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles);

/// Sends a reply with a file descriptor beside it.
using SendWithDescriptor = std::function<void(const nlohmann::json& result, int descriptor)>;

/// The method `state.open`: answers {"layout": ...} with the memory's descriptor as ancillary data
/// (SCM_RIGHTS) of that line's first byte. Not RT safe.
void open_state(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles,
                const SendWithDescriptor& send);

}  // namespace wrenchd
