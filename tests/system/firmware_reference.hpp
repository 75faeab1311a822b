// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tests/system/row.hpp"

namespace wrenchd::test {

/// Row of the kernel test in which the firmware of devices/firmware is checked against the rules of the open
/// report layout, as it is and with an inverted force.
void firmware_reference(Backend backend);

}  // namespace wrenchd::test
