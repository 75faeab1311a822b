// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tests/system/row.hpp"

namespace wrenchd::test {

/// Rows of the kernel test in which Linux saves power: a device that nobody uses is suspended, and the
/// machine sleeps while a device is armed.
void power_saving(Backend backend);

}  // namespace wrenchd::test
