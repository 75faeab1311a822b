// SPDX-License-Identifier: GPL-3.0-or-later
// For every processor.
#define WRENCHD_SIFT sift_portable
#include "collision/pairs/pair_culler_kernel.hpp"
