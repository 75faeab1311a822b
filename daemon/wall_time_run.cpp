// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/wall_time_run.hpp"

#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include <spdlog/spdlog.h>

#include "daemon/contact_rate.hpp"
#include "daemon/servo/realtime_watch.hpp"
#include "daemon/servo_thread.hpp"
#include "daemon/thread_guard.hpp"

namespace wrenchd {
namespace {

/// Starts to tick the loop: on a thread of its own, or on the thread of both hands.
std::unique_ptr<RunningLoop> start_loop(Runtime& runtime, const RunContext& context, Clock& clock) {
  if (context.two_hands != nullptr) return context.two_hands->thread.run(context.hand, runtime.loop());
  return start_servo_thread(runtime.config().settings.servo, runtime.loop(), clock);
}

/// The service manager reads the loop until this object is destroyed.
class ServiceStatus {
 public:
  ServiceStatus(const ServoLoop& loop, const RunContext& context, const std::string& device)
      : context_(context) {
    const auto status = [&loop] {
      return LoopStatus{loop.telemetry().state(), loop.telemetry().cause(),
                        loop.telemetry().timing().tick.count()};
    };
    context.service.running(status, device, context.hand);
  }
  ~ServiceStatus() { context_.service.loop_ended(context_.hand); }
  ServiceStatus(const ServiceStatus&) = delete;
  ServiceStatus& operator=(const ServiceStatus&) = delete;

 private:
  const RunContext& context_;
};

/// Logs that real time was lost or regained. If real time is required, its loss disarms the loop.
void report_realtime(const RealtimeWatch::Change& change, Runtime& runtime) {
  const bool disarms = change.lost && runtime.config().settings.servo.realtime == Realtime::required;
  if (disarms) runtime.loop().requests().disarm();
  spdlog::log(change.lost ? spdlog::level::err : spdlog::level::info, "{}{}", change.message,
              disarms ? "; disarmed, because realtime = \"required\"" : "");
}

/// Logs the rate that the scene allows, as soon as CGAL detects the contacts. A client may choose CGAL while
/// the loop runs.
class ContactRateLog {
 public:
  explicit ContactRateLog(Runtime& runtime)
      : runtime_(runtime), report_(runtime.config().settings.servo.rate_Hz) {}

  void check() {
    if (runtime_.reconfigurator().contacts() != ContactBackend::cgal) return;
    if (!std::exchange(started_, true)) spdlog::warn("{}", ContactRateReport::start_text());
    print(report_.check(runtime_.loop().telemetry().timing()));
  }
  void close() {
    if (started_) print(report_.close(runtime_.loop().telemetry().timing()));
  }

 private:
  static void print(const std::optional<ContactRateReport::Message>& message) {
    if (message)
      spdlog::log(message->too_slow ? spdlog::level::warn : spdlog::level::info, "{}", message->text);
  }

  Runtime& runtime_;
  ContactRateReport report_;
  bool started_ = false;
};

}  // namespace

Fault run_in_wall_time(Runtime& runtime, const RunContext& context, const std::string& device, TimePoint end,
                       WallClock& clock, LiveView& view, ScheduledRequests& requests) {
  ServoLoop& loop = runtime.loop();
  const std::unique_ptr<RunningLoop> running = start_loop(runtime, context, clock);
  const ServiceStatus service_status(loop, context, device);
  RealtimeWatch realtime(running->thread());
  ContactRateLog contact_rate(runtime);
  ThreadGuard guard("supervision of the loop");
  while (!context.stop_requested() && !running->ended() && clock.now() < end) {
    std::this_thread::sleep_until(requests.next_time(clock.now() + kSamplePeriod));
    requests.send_due(loop, clock.now());
    guard.run([&] { view.sample(loop); });
    guard.run([&] { contact_rate.check(); });
    guard.run([&] {
      if (const auto change = realtime.check()) report_realtime(*change, runtime);
    });
  }
  const Fault latched = latched_fault(loop);
  if (!running->ended()) context.service.stopping("stopping");
  const Fault fault = running->join();
  contact_rate.close();
  return fault == Fault::none ? latched : fault;
}

}  // namespace wrenchd
