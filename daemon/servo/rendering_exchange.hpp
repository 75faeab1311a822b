// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <memory>

#include <boost/lockfree/spsc_queue.hpp>

#include "daemon/servo/rendering.hpp"

namespace wrenchd {

/// Hands renderings to the servo thread, and takes back those that it is done with: what is built and
/// destroyed elsewhere it only ever borrows. Between one thread that offers and one that takes.
class RenderingExchange {
 public:
  RenderingExchange() = default;
  ~RenderingExchange() {
    delete offered_.load(std::memory_order_acquire);
    destroy_retired();
  }
  RenderingExchange(const RenderingExchange&) = delete;
  RenderingExchange& operator=(const RenderingExchange&) = delete;

  // --- the thread that builds ---

  /// Offers this one, in the place of one that was not taken yet. True where there was one.
  bool offer(std::unique_ptr<Rendering> rendering) noexcept {
    destroy_retired();
    const std::unique_ptr<Rendering> forgone(
        offered_.exchange(rendering.release(), std::memory_order_acq_rel));
    return forgone != nullptr;
  }
  /// Was what was offered last taken?
  bool taken() const noexcept { return offered_.load(std::memory_order_acquire) == nullptr; }
  /// Destroys what was given back.
  void destroy_retired() noexcept {
    retired_.consume_all([](Rendering* rendering) { delete rendering; });
  }

  // --- the servo thread: RT safe ---

  /// What is offered, if anything is. It has to be given back.
  Rendering* take() noexcept {
    if (offered_.load(std::memory_order_relaxed) == nullptr) return nullptr;
    return offered_.exchange(nullptr, std::memory_order_acq_rel);
  }
  /// There is always room: one is given back for one that was taken, and each offer() has cleaned up before.
  void retire(Rendering* rendering) noexcept { retired_.push(rendering); }

 private:
  std::atomic<Rendering*> offered_{nullptr};
  static_assert(std::atomic<Rendering*>::is_always_lock_free);
  /// Since the last clean-up one may have been offered and taken, and another been on its way in.
  boost::lockfree::spsc_queue<Rendering*, boost::lockfree::capacity<8>> retired_;
};

}  // namespace wrenchd
