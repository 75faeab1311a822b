// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/virtual_time_run.hpp"

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

Fault run_in_virtual_time(Runtime& runtime, const RunContext& context, Recordings& recordings, TimePoint end,
                          VirtualClock& clock, LiveView& view, ScheduledRequests& requests) {
  ServoLoop& loop = runtime.loop();
  const Duration period = from_seconds(1.0 / runtime.config().settings.servo.rate_Hz);
  TimePoint next_sample = clock.now() + kSamplePeriod;
  Fault fault = Fault::none;
  const ServoThreadMark mark;
  while (fault != Fault::device_lost && clock.now() < end && !context.signals.stop_requested()) {
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

}  // namespace wrenchd
