// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for AVX2 and FMA, and called only where the processor has them.
#define WRENCHD_SIFT sift_avx2
#include "collision/pairs/pair_culler_kernel.hpp"
