// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/process_signals.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <string>
#include <thread>

#include <unistd.h>

#include "daemon/servo/servo_loop.hpp"
#include "daemon/standard_streams.hpp"

namespace wrenchd {
namespace {

/// Longest wait for the servo thread to release the hand. A loop that does not tick in this time hangs; then
/// the writer thread of the link has sent a zero wrench (devices/links/host_watchdog.hpp).
constexpr long kReleaseWithin_us = 100'000;
/// Period in which the handler samples the loop. It ticks once a millisecond, as configured by default.
constexpr long kPollPeriod_us = 200;
/// A thread of the link writes the zero wrench of a release. A process that ends leaves it this time.
constexpr long kWriteTime_us = 50'000;

// A signal handler has no argument, so its state is static. It uses lock-free atomics only.
std::atomic<bool> stop_flag{false};
std::atomic<bool> reload_flag{false};
/// The loops of the signal targets; null: none.
std::array<std::atomic<ServoLoop*>, SignalTarget::kMaxTargets> targets{};
std::atomic<int> handlers_using_targets{0};
std::atomic<pid_t> servo_thread{0};  ///< 0: no thread ticks the loop
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
                  std::atomic<CommandSet>::is_always_lock_free &&
                  std::atomic<ServoLoop*>::is_always_lock_free && std::atomic<State>::is_always_lock_free,
              "a signal handler may only use lock-free atomics");

/// While this object lives, ~SignalTarget() does not return.
class TargetUse {
 public:
  TargetUse() noexcept { handlers_using_targets.fetch_add(1); }
  ~TargetUse() { handlers_using_targets.fetch_sub(1); }
  TargetUse(const TargetUse&) = delete;
  TargetUse& operator=(const TargetUse&) = delete;
};

/// Calls `use` with each servo loop.
template <class Use>
void for_each_target(const Use& use) {
  const TargetUse in_use;
  for (const std::atomic<ServoLoop*>& target : targets)
    if (ServoLoop* const loop = target.load()) use(*loop);
}

bool has_target() noexcept {
  return std::any_of(targets.begin(), targets.end(),
                     [](const std::atomic<ServoLoop*>& target) { return target.load() != nullptr; });
}

void sleep_us(long us) noexcept {
  timespec time{0, us * 1000};
  while (::nanosleep(&time, &time) != 0 && errno == EINTR) {
  }
}

struct sigaction set_handler(int signal, void (*handler)(int)) {
  struct sigaction action {
  }, previous{};
  action.sa_handler = handler;
  sigaction(signal, &action, &previous);
  return previous;
}

constexpr std::array kCrashSignals = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGSYS, SIGTRAP, SIGABRT, SIGXCPU};
/// The actions of kCrashSignals before this file replaced them: the default, or those of a sanitizer.
std::array<struct sigaction, kCrashSignals.size()> previous_actions;

/// Restores the previous action, which ends the process when this handler returns: the fault occurs again, or
/// raise() repeats the signal.
void release_and_crash(int signal) {
  release_hand_before_exit();
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i)
    if (kCrashSignals[i] == signal) sigaction(signal, &previous_actions[i], nullptr);
  ::raise(signal);
}

[[noreturn]] void release_and_abort() {
  release_hand_before_exit();
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
    write_error_without_waiting("wrenchd: ended by std::terminate()\n");
  } catch (const std::exception& error) {
    write_error_without_waiting(std::string("wrenchd: ended by an exception that nobody handles: ") +
                                error.what() + "\n");
  } catch (...) {
    write_error_without_waiting("wrenchd: ended by an unknown exception that nobody handles\n");
  }
  set_handler(SIGABRT, SIG_DFL);
  std::abort();
}

}  // namespace

void release_hand_before_exit() noexcept {
  const TargetUse in_use;
  if (!has_target()) return;
  const auto is_released = [](const ServoLoop& loop) { return loop.telemetry().state() == State::shutdown; };
  const auto all_released = [&is_released] {
    bool all = true;
    for_each_target([&](const ServoLoop& loop) { all = all && is_released(loop); });
    return all;
  };
  const pid_t thread = servo_thread.load();
  if (thread == 0 || thread == ::gettid()) {  // no tick runs
    for_each_target([&is_released](ServoLoop& loop) {
      if (!is_released(loop)) loop.release(std::chrono::steady_clock::now());
    });
    return sleep_us(kWriteTime_us);
  }
  // The stop removes the force in the next tick, whatever the state; then the loop can end at once. It is
  // requested for good, because a loop that ticks on would take the device for a new one and test it.
  for_each_target([](ServoLoop& loop) { loop.requests().request_for_good(kStop | kQuit); });
  for (long us = 0, since_release_us = 0; us < kReleaseWithin_us && since_release_us < kWriteTime_us;
       us += kPollPeriod_us) {
    if (since_release_us > 0 || all_released()) since_release_us += kPollPeriod_us;
    sleep_us(kPollPeriod_us);
  }
}

ProcessSignals::ProcessSignals() {
  const auto stop = [](int) { stop_flag.store(true); };
  for (const int signal : {SIGINT, SIGTERM, SIGQUIT, SIGPWR, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGSTKFLT})
    set_handler(signal, stop);
  for (int signal = SIGRTMIN; signal <= SIGRTMAX; ++signal) set_handler(signal, stop);
  set_handler(SIGHUP, [](int) { reload_flag.store(true); });
  set_handler(SIGUSR1, [](int) { for_each_target([](ServoLoop& loop) { loop.requests().request(kStop); }); });
  set_handler(SIGUSR2,
              [](int) { for_each_target([](ServoLoop& loop) { loop.requests().request(kAcknowledge); }); });
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTSTP, SIGTTIN, SIGTTOU}) set_handler(signal, SIG_IGN);
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i)
    previous_actions[i] = set_handler(kCrashSignals[i], release_and_crash);
  std::set_terminate(release_and_abort);
}

bool ProcessSignals::stop_requested() const noexcept {
  return stop_flag.load();
}

bool ProcessSignals::take_reload_request() const noexcept {
  return reload_flag.exchange(false);
}

SignalTarget::SignalTarget(ServoLoop& loop) noexcept : loop_(loop) {
  for (std::atomic<ServoLoop*>& target : targets) {
    ServoLoop* none = nullptr;
    if (target.compare_exchange_strong(none, &loop)) return;
  }
}

SignalTarget::~SignalTarget() {
  for (std::atomic<ServoLoop*>& target : targets)
    if (target.load() == &loop_) target.store(nullptr);
  while (handlers_using_targets.load() != 0) std::this_thread::yield();
}

ServoThreadMark::ServoThreadMark() noexcept {
  servo_thread.store(::gettid());
}

ServoThreadMark::~ServoThreadMark() {
  servo_thread.store(0);
}

}  // namespace wrenchd
