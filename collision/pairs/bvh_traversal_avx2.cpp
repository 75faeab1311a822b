// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for AVX2 and FMA, and called only where the processor has them.
#define WRENCHD_WALK walk_avx2
#include "collision/pairs/bvh_traversal_kernel.hpp"
