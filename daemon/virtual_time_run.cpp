// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/virtual_time_run.hpp"

#include <utility>

#include "daemon/device_start.hpp"
#include "daemon/log_prefix.hpp"
#include "daemon/servo/servo_loop.hpp"
#include "daemon/servo/two_loops.hpp"

namespace wrenchd {

Fault run_in_virtual_time(Runtime& runtime, const RunContext& context, Recordings& recordings, TimePoint end,
                          VirtualClock& clock, LiveView& view, ScheduledRequests& requests) {
  ServoLoop& loop = runtime.loop();
  const Duration period = from_seconds(1.0 / runtime.config().settings.servo.rate_Hz);
  TimePoint next_sample = clock.now() + kSamplePeriod;
  Fault fault = Fault::none;
  const ServoThreadMark mark;
  while (fault != Fault::device_lost && clock.now() < end && !context.stop_requested()) {
    clock.sleep_until(clock.now() + period);
    fault = loop.tick(clock.now(), clock.now());
    requests.send_due(loop, clock.now());
    if (clock.now() < next_sample) continue;
    next_sample += kSamplePeriod;
    view.sample(loop);
    recordings.pump();
  }
  if (fault == Fault::device_lost) return fault;
  fault = latched_fault(loop);
  loop.release(clock.now());
  return fault;
}

namespace {

/// Opens the device of a hand again after it was unplugged, and ticks its loop again.
void reconnect(TwoLoops& loops, VirtualHand& hand) {
  const std::size_t i = hand.context.hand;
  if (loops.attached(i)) return;
  const LogPrefix prefix(hand.runtime.config().hand());
  if (!std::exchange(hand.unplugged, true)) {
    hand.runtime.close();
    hand.requests.cancel_arm();
    log_unplugged(hand.context);
  }
  if (!open_again(hand.runtime)) return;
  hand.unplugged = false;
  loops.attach(i, hand.runtime.loop());
}

}  // namespace

std::array<Fault, 2> run_two_in_virtual_time(std::array<VirtualHand, 2>& hands, TimePoint end,
                                             VirtualClock& clock) {
  const Duration period = from_seconds(1.0 / hands[0].runtime.config().settings.servo.rate_Hz);
  TwoLoops loops(clock.now(), period);
  TimePoint next_sample = clock.now() + kSamplePeriod;
  const ServoThreadMark mark;
  for (std::size_t i = 0; i < hands.size(); ++i) loops.attach(i, hands[i].runtime.loop());
  while (clock.now() < end && !hands[0].context.stop_requested()) {
    loops.step(clock);
    for (VirtualHand& hand : hands) {
      reconnect(loops, hand);
      hand.requests.send_due(hand.runtime.loop(), clock.now());
    }
    if (clock.now() < next_sample) continue;
    next_sample += kSamplePeriod;
    for (VirtualHand& hand : hands) {
      hand.view.sample(hand.runtime.loop());
      hand.recordings.pump();
    }
  }
  std::array<Fault, 2> faults{};
  for (std::size_t i = 0; i < hands.size(); ++i) {
    ServoLoop& loop = hands[i].runtime.loop();
    faults[i] = latched_fault(loop);
    if (loops.attached(i)) loop.release(clock.now());
  }
  return faults;
}

}  // namespace wrenchd
