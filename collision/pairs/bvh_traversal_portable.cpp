// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled for every processor.
#define WRENCHD_TRAVERSE traverse_portable
#include "collision/pairs/bvh_traversal_kernel.hpp"

namespace wrenchd::simd {

bool has_avx2() noexcept {
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}

}  // namespace wrenchd::simd
