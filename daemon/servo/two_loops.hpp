// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

class ServoLoop;

/// Releases the other hand if a fault has released the hand of `loop` and both tools hold the same body. Call
/// it after each tick. held_before: number of the body that the tool of `loop` held before the tick, because
/// a lost device lets go in the tick; 0: none. RT-safe.
void release_other_hand(const ServoLoop& loop, std::size_t held_before, ServoLoop& other) noexcept;

/// Ticks the servo loops of two hands in turn on one thread. The second loop ticks half a period after the
/// first one: so no tick delays the other loop by more than its own length, and each tick has a fresh pose.
///
/// Other threads attach a loop when its device is open. The servo thread detaches the loop when its device is
/// lost, or when the loop was asked to end and its force has faded; the other loop goes on. The thread that
/// attached a loop is the only one that asks it to end and attaches it again. Functions for other threads do
/// not wait.
class TwoLoops {
 public:
  static constexpr std::size_t kHands = 2;

  /// The first tick of the first loop is due a period after `start`.
  TwoLoops(TimePoint start, Duration period) noexcept;

  /// Ticks this loop from its next due time on. Precondition: the hand has no attached loop. Other threads.
  void attach(std::size_t hand, ServoLoop& loop) noexcept;
  /// Asks the loop to fade its force out, to release the hand and to end. Harmless if it has ended. Other
  /// threads.
  void end(std::size_t hand) noexcept;
  /// Returns true until the loop has ended. Afterwards the servo thread does not use it any more. Any thread.
  bool attached(std::size_t hand) const noexcept;
  /// Returns why the loop ended: device_lost or none. Precondition: attached() returned false. Other threads.
  Fault fault(std::size_t hand) const noexcept;

  /// Sleeps until the next due time of either hand, and ticks the loop of that hand if there is one. If a
  /// loop fell behind, it skips the missed ticks, as ServoLoop::run(). RT-safe, except for the sleep.
  void step(Clock& clock) noexcept;
  /// Calls step() until `stop` is set and both loops have ended. Servo thread.
  void run(Clock& clock, const std::atomic<bool>& stop) noexcept;

 private:
  struct Hand {
    std::atomic<ServoLoop*> loop{nullptr};  ///< the servo thread stores null when the loop has ended
    std::atomic<bool> ending{false};
    std::atomic<Fault> fault{Fault::none};
    TimePoint due{};  ///< when the next tick is due; used by the servo thread only
  };

  void tick(Hand& hand, ServoLoop& loop, TimePoint now) noexcept;

  Duration period_;
  std::optional<TimePoint> scene_start_;  ///< time of the first tick of either hand
  std::array<Hand, kHands> hands_;
};

}  // namespace wrenchd
