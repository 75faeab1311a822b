// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/two_loops.hpp"

#include <cstddef>
#include <cstdint>

#include "core/state.hpp"
#include "daemon/servo/due_time.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

void release_other_hand(const ServoLoop& loop, std::size_t held_before, ServoLoop& other) noexcept {
  const State state = loop.telemetry().state();
  const bool released = state == State::fault || state == State::stopped || state == State::disconnected;
  const bool armed = is_driving(other.telemetry().state()) || other.telemetry().state() == State::waiting;
  if (released && armed && held_before != 0 && other.held_body() == held_before)
    other.requests().release_with_other_hand();
}

TwoLoops::TwoLoops(TimePoint start, Duration period) noexcept : period_(period) {
  hands_[0].due = start + period;
  hands_[1].due = start + period + period / 2;
}

void TwoLoops::attach(std::size_t hand, ServoLoop& loop) noexcept {
  Hand& to = hands_[hand];
  to.ending.store(false, std::memory_order_relaxed);
  to.fault.store(Fault::none, std::memory_order_relaxed);
  to.loop.store(&loop, std::memory_order_release);
}

void TwoLoops::end(std::size_t hand) noexcept {
  hands_[hand].ending.store(true, std::memory_order_relaxed);
}

bool TwoLoops::attached(std::size_t hand) const noexcept {
  return hands_[hand].loop.load(std::memory_order_acquire) != nullptr;
}

Fault TwoLoops::fault(std::size_t hand) const noexcept {
  return hands_[hand].fault.load(std::memory_order_relaxed);
}

void TwoLoops::step(Clock& clock) noexcept {
  Hand& hand = hands_[1].due < hands_[0].due ? hands_[1] : hands_[0];
  clock.sleep_until(hand.due);
  ServoLoop* const loop = hand.loop.load(std::memory_order_acquire);
  if (loop != nullptr) tick(hand, *loop, clock.now());
  hand.due += period_;
  const std::uint64_t missed = skip_missed_ticks(hand.due, period_, clock.now());
  // A loop that has just ended may be destroyed already.
  if (missed > 0 && loop != nullptr && hand.loop.load(std::memory_order_relaxed) == loop)
    loop->telemetry().count_overrun(missed);
}

void TwoLoops::tick(Hand& hand, ServoLoop& loop, TimePoint now) noexcept {
  const auto ended = [&hand](Fault fault) {
    hand.fault.store(fault, std::memory_order_relaxed);
    hand.loop.store(nullptr, std::memory_order_release);
  };
  if (hand.ending.load(std::memory_order_relaxed)) {
    if (loop.telemetry().state() == State::shutdown) return ended(Fault::none);
    loop.requests().request(kQuit);
  }
  if (!scene_start_) scene_start_ = now;
  loop.start_scene_at(*scene_start_);
  const std::size_t held = loop.held_body();
  const Fault fault = loop.tick(now, hand.due);
  Hand& other = &hand == &hands_[0] ? hands_[1] : hands_[0];
  if (ServoLoop* const other_loop = other.loop.load(std::memory_order_acquire); other_loop != nullptr)
    release_other_hand(loop, held, *other_loop);
  if (fault == Fault::device_lost) ended(Fault::device_lost);  // the hand was released
}

void TwoLoops::run(Clock& clock, const std::atomic<bool>& stop) noexcept {
  while (!stop.load(std::memory_order_relaxed) || attached(0) || attached(1)) step(clock);
}

}  // namespace wrenchd
