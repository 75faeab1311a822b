// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for every processor.
#define WRENCHD_SEPARATED separated_portable
#include "collision/pairs/separating_axes_kernel.hpp"
