// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd::test {

/// Counts operations that the servo thread must not perform, on the thread that owns the guard: heap
/// allocation and release (new, malloc and related functions, also inside libraries), and mutex locks.
class RealtimeGuard {
 public:
  RealtimeGuard() noexcept;
  ~RealtimeGuard();
  RealtimeGuard(const RealtimeGuard&) = delete;
  RealtimeGuard& operator=(const RealtimeGuard&) = delete;

  std::uint64_t allocations() const noexcept;
  std::uint64_t locks() const noexcept;
};

}  // namespace wrenchd::test
