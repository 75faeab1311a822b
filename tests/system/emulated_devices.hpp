// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tests/system/row.hpp"

namespace wrenchd::test {

/// Rows of the kernel test with emulated devices: each is connected, found by its shipped profile, and driven
/// over one of the backends.
void emulated_devices(Backend backend);

}  // namespace wrenchd::test
