// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo_thread.hpp"

#include <chrono>
#include <exception>

#include <unistd.h>

#include "daemon/process_signals.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

/// Time between two checks whether a loop of two has ended. The servo thread wakes nobody.
constexpr auto kEndPeriod = std::chrono::milliseconds(1);

class OneHandThread final : public RunningLoop {
 public:
  OneHandThread(const ServoSettings& settings, ServoLoop& loop, Clock& clock)
      : thread_([this, &settings, &loop, &clock] { run(settings, loop, clock); }) {}
  ~OneHandThread() override { OneHandThread::join(); }

  /// Waits until the thread has asked the kernel for real time. Rethrows its RealtimeError.
  std::vector<RealtimeGrant> grants() { return prepared_.get_future().get(); }
  pid_t thread() const override { return id_.load(); }
  bool ended() const override { return ended_.load(); }

  Fault join() noexcept override {
    if (!thread_.joinable()) return fault_;
    stop_.store(true);
    thread_.join();
    return fault_;
  }

 private:
  void run(const ServoSettings& settings, ServoLoop& loop, Clock& clock) {
    const ServoThreadMark mark;
    try {
      id_.store(gettid());
      prepared_.set_value(prepare_servo_thread(settings));
      fault_ = loop.run(clock, stop_);
    } catch (...) {  // only prepare_servo_thread() throws, before the loop runs
      prepared_.set_exception(std::current_exception());
    }
    ended_.store(true);
  }

  std::promise<std::vector<RealtimeGrant>> prepared_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::atomic<pid_t> id_{0};
  Fault fault_ = Fault::none;  ///< valid after join()
  std::thread thread_;         ///< last member: it uses all of the above
};

/// One of the loops of a TwoHandThread.
class OneOfTwo final : public RunningLoop {
 public:
  OneOfTwo(TwoLoops& loops, std::size_t hand, pid_t thread) : loops_(loops), hand_(hand), thread_(thread) {}
  ~OneOfTwo() override { OneOfTwo::join(); }

  pid_t thread() const override { return thread_; }
  bool ended() const override { return joined_ || !loops_.attached(hand_); }
  Fault join() noexcept override {
    if (joined_) return fault_;  // the hand may have another loop by now
    for (loops_.end(hand_); loops_.attached(hand_);) std::this_thread::sleep_for(kEndPeriod);
    fault_ = loops_.fault(hand_);
    joined_ = true;
    return fault_;
  }

 private:
  TwoLoops& loops_;
  const std::size_t hand_;
  const pid_t thread_;
  bool joined_ = false;
  Fault fault_ = Fault::none;  ///< valid if joined_
};

}  // namespace

std::unique_ptr<RunningLoop> start_servo_thread(const ServoSettings& settings, ServoLoop& loop,
                                                Clock& clock) {
  auto thread = std::make_unique<OneHandThread>(settings, loop, clock);
  log_grants(thread->grants());
  return thread;
}

TwoHandThread::TwoHandThread(const ServoSettings& settings, Clock& clock)
    : loops_(clock.now(), from_seconds(1.0 / settings.rate_Hz)), thread_([this, &settings, &clock] {
        const ServoThreadMark mark;
        try {
          id_.store(gettid());
          prepared_.set_value(prepare_servo_thread(settings));
          loops_.run(clock, stop_);
        } catch (...) {  // only prepare_servo_thread() throws
          prepared_.set_exception(std::current_exception());
        }
      }) {
  try {
    log_grants(prepared_.get_future().get());
  } catch (...) {
    thread_.join();
    throw;
  }
}

TwoHandThread::~TwoHandThread() {
  stop_.store(true);
  thread_.join();
}

std::unique_ptr<RunningLoop> TwoHandThread::run(std::size_t hand, ServoLoop& loop) {
  loops_.attach(hand, loop);
  return std::make_unique<OneOfTwo>(loops_, hand, id_.load());
}

}  // namespace wrenchd
