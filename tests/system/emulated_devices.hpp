// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tests/system/row.hpp"

namespace wrenchd::test {

/// The rows of the kernel test in which emulators of real devices are plugged in, found by their shipped
/// profiles, and driven over one of the backends.
void emulated_devices(Backend backend);

}  // namespace wrenchd::test
