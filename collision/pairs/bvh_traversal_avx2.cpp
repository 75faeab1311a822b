// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for AVX2 and FMA; called only on processors that support them.
#define WRENCHD_TRAVERSE traverse_avx2
#include "collision/pairs/bvh_traversal_kernel.hpp"
