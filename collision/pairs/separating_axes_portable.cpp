// SPDX-License-Identifier: GPL-3.0-or-later
// For every processor.
#define WRENCHD_APART apart_portable
#include "collision/pairs/separating_axes_kernel.hpp"
