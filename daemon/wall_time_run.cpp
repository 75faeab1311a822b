// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/wall_time_run.hpp"

#include <atomic>
#include <exception>
#include <future>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/contact_rate.hpp"
#include "daemon/realtime.hpp"
#include "daemon/servo/realtime_watch.hpp"
#include "daemon/thread_guard.hpp"

namespace wrenchd {
namespace {

/// The servo thread. Its destructor ends the loop and joins the thread.
class ServoThread {
 public:
  ServoThread(Runtime& runtime, WallClock& clock, ServiceNotify& service)
      : service_(service), thread_([this, &runtime, &clock] { run(runtime, clock); }) {}
  ~ServoThread() { join(); }
  ServoThread(const ServoThread&) = delete;
  ServoThread& operator=(const ServoThread&) = delete;

  /// Waits until the thread has asked the kernel for real time. Rethrows its RealtimeError.
  std::vector<RealtimeGrant> grants() { return prepared_.get_future().get(); }
  pid_t id() const { return id_.load(); }
  bool ended() const { return ended_.load(); }

  /// Ends the loop. Returns the fault that ended it.
  Fault join() noexcept {
    if (!thread_.joinable()) return fault_;
    stop_.store(true);
    thread_.join();
    service_.loop_ended();
    return fault_;
  }

 private:
  void run(Runtime& runtime, WallClock& clock) {
    const ServoThreadMark mark;
    try {
      id_.store(gettid());
      prepared_.set_value(prepare_servo_thread(runtime.config().settings.servo));
      fault_ = runtime.loop().run(clock, stop_);
    } catch (...) {  // only prepare_servo_thread() throws, before the loop runs
      prepared_.set_exception(std::current_exception());
    }
    ended_.store(true);
  }

  ServiceNotify& service_;
  std::promise<std::vector<RealtimeGrant>> prepared_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::atomic<pid_t> id_{0};
  Fault fault_ = Fault::none;  ///< valid after join()
  std::thread thread_;         ///< last member: it uses all of the above
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
  ServoThread servo_thread(runtime, clock, context.service);
  log_grants(servo_thread.grants());
  context.service.running(
      [&loop] {
        return LoopStatus{loop.telemetry().state(), loop.telemetry().cause(),
                          loop.telemetry().timing().tick.count()};
      },
      device);
  RealtimeWatch realtime(servo_thread.id());
  ContactRateLog contact_rate(runtime);
  ThreadGuard guard("supervision of the loop");
  while (!context.signals.stop_requested() && !servo_thread.ended() && clock.now() < end) {
    std::this_thread::sleep_until(requests.next_time(clock.now() + kSamplePeriod));
    requests.send_due(loop, clock.now());
    guard.run([&] { view.sample(loop); });
    guard.run([&] { contact_rate.check(); });
    guard.run([&] {
      if (const auto change = realtime.check()) report_realtime(*change, runtime);
    });
  }
  const Fault latched = latched_fault(loop);
  if (!servo_thread.ended()) context.service.stopping("stopping");
  const Fault fault = servo_thread.join();
  contact_rate.close();
  return fault == Fault::none ? latched : fault;
}

}  // namespace wrenchd
