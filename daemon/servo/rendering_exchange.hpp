// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <memory>

#include <boost/lockfree/spsc_queue.hpp>

#include "daemon/servo/rendering.hpp"

namespace wrenchd {

/// Passes renderings from one building thread to the servo thread, and retired renderings back. The building
/// thread allocates and frees; the servo thread only borrows.
class RenderingExchange {
 public:
  RenderingExchange() = default;
  /// Destroys the offered rendering and all retired ones. Not RT-safe: frees memory.
  ~RenderingExchange() {
    delete offered_.load(std::memory_order_acquire);
    destroy_retired();
  }
  RenderingExchange(const RenderingExchange&) = delete;
  RenderingExchange& operator=(const RenderingExchange&) = delete;

  // --- building thread ---

  /// Offers `rendering` to the servo thread. Destroys a previous offer that was not taken, and returns true
  /// in that case. Not RT-safe: frees memory.
  bool offer(std::unique_ptr<Rendering> rendering) noexcept {
    destroy_retired();
    const std::unique_ptr<Rendering> replaced(
        offered_.exchange(rendering.release(), std::memory_order_acq_rel));
    return replaced != nullptr;
  }
  /// Returns true if the servo thread took the last offer. RT-safe.
  bool taken() const noexcept { return offered_.load(std::memory_order_acquire) == nullptr; }
  /// Destroys all retired renderings. Not RT-safe: frees memory.
  void destroy_retired() noexcept {
    retired_.consume_all([](Rendering* rendering) { delete rendering; });
  }

  // --- servo thread ---

  /// Returns the offered rendering, or null if there is no offer. The caller must later pass it to retire().
  /// RT-safe.
  Rendering* take() noexcept {
    if (offered_.load(std::memory_order_relaxed) == nullptr) return nullptr;
    return offered_.exchange(nullptr, std::memory_order_acq_rel);
  }
  /// Returns a rendering to the building thread for destruction. The queue never overflows: each retired
  /// rendering was offered once, and every offer() empties the queue first. RT-safe.
  void retire(Rendering* rendering) noexcept { retired_.push(rendering); }

 private:
  std::atomic<Rendering*> offered_{nullptr};
  static_assert(std::atomic<Rendering*>::is_always_lock_free);
  /// At most two renderings are retired between two calls of offer().
  boost::lockfree::spsc_queue<Rendering*, boost::lockfree::capacity<8>> retired_;
};

}  // namespace wrenchd
