// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for every processor.
#define WRENCHD_CULL cull_portable
#include "collision/pairs/pair_culler_kernel.hpp"
