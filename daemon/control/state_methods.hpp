// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/control/control_methods.hpp"

namespace wrenchd {

class Runtime;

/// The row of `state.open`. The station shows its state from here on, so its loop may not run yet; it must
/// outlive the table. Throws std::system_error where there is no memory to show it in.
void add_state_methods(MethodTable& table, Runtime& station);

}  // namespace wrenchd
