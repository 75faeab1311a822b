// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <memory>

#include <boost/lockfree/spsc_queue.hpp>

#include "daemon/servo/rendering.hpp"

namespace wrenchd {

/// Passes renderings to the servo thread and back, so that the servo thread neither allocates nor destroys
/// them. One thread offers, the servo thread takes.
class RenderingExchange {
 public:
  RenderingExchange() = default;
  ~RenderingExchange() {
    delete offered_.load(std::memory_order_acquire);
    destroy_retired();
  }
  RenderingExchange(const RenderingExchange&) = delete;
  RenderingExchange& operator=(const RenderingExchange&) = delete;

  // --- the thread that builds renderings ---

  /// Offers a rendering. It replaces one that was offered before and not taken yet; returns true if there was
  /// one. Not RT-safe: destroys.
  bool offer(std::unique_ptr<Rendering> rendering) noexcept {
    destroy_retired();
    const std::unique_ptr<Rendering> replaced(
        offered_.exchange(rendering.release(), std::memory_order_acq_rel));
    return replaced != nullptr;
  }
  /// True if the servo thread took the last offer. RT-safe.
  bool taken() const noexcept { return offered_.load(std::memory_order_acquire) == nullptr; }
  /// Destroys the renderings that the servo thread retired. Not RT-safe: destroys.
  void destroy_retired() noexcept {
    retired_.consume_all([](Rendering* rendering) { delete rendering; });
  }

  // --- the servo thread ---

  /// Takes the offer; null if there is none. The taker must retire() it in the end. RT-safe.
  Rendering* take() noexcept {
    if (offered_.load(std::memory_order_relaxed) == nullptr) return nullptr;
    return offered_.exchange(nullptr, std::memory_order_acq_rel);
  }
  /// Returns a rendering for destruction. There is always room: each retired rendering makes place for one
  /// that was taken, and offer() destroys the retired ones first. RT-safe.
  void retire(Rendering* rendering) noexcept { retired_.push(rendering); }

 private:
  std::atomic<Rendering*> offered_{nullptr};
  static_assert(std::atomic<Rendering*>::is_always_lock_free);
  /// Between two offers, at most two renderings are retired.
  boost::lockfree::spsc_queue<Rendering*, boost::lockfree::capacity<8>> retired_;
};

}  // namespace wrenchd
