// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/process_signals.hpp"

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <thread>

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

/// A thread of the link writes the zero wrench of a release. A process that aborts leaves it this time.
constexpr auto kReleaseTime = std::chrono::milliseconds(50);

// A signal handler has no argument, so its state is static. It uses lock-free atomics only.
std::atomic<bool> stop_flag{false};
std::atomic<bool> reload_flag{false};
std::atomic<ServoLoop*> target{nullptr};
std::atomic<int> handlers_using_target{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
                  std::atomic<CommandSet>::is_always_lock_free &&
                  std::atomic<ServoLoop*>::is_always_lock_free,
              "a signal handler may only use lock-free atomics");

/// Calls `use` with the servo loop, if there is one. The count keeps ~SignalTarget() from returning
/// meanwhile.
template <class Use>
void with_target(const Use& use) {
  handlers_using_target.fetch_add(1);
  if (ServoLoop* const loop = target.load()) use(*loop);
  handlers_using_target.fetch_sub(1);
}

void set_handler(int signal, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  sigaction(signal, &action, nullptr);
}

[[noreturn]] void release_and_abort() {
  with_target([](ServoLoop& loop) {
    loop.release(std::chrono::steady_clock::now());
    std::this_thread::sleep_for(kReleaseTime);
  });
  std::abort();
}

}  // namespace

ProcessSignals::ProcessSignals() {
  for (const int signal : {SIGINT, SIGTERM}) set_handler(signal, [](int) { stop_flag.store(true); });
  set_handler(SIGHUP, [](int) { reload_flag.store(true); });
  set_handler(SIGUSR1, [](int) { with_target([](ServoLoop& loop) { loop.requests().request(kStop); }); });
  set_handler(SIGUSR2,
              [](int) { with_target([](ServoLoop& loop) { loop.requests().request(kAcknowledge); }); });
  std::set_terminate(release_and_abort);
}

bool ProcessSignals::stop_requested() const noexcept {
  return stop_flag.load();
}

bool ProcessSignals::take_reload_request() const noexcept {
  return reload_flag.exchange(false);
}

SignalTarget::SignalTarget(ServoLoop& loop) noexcept {
  target.store(&loop);
}

SignalTarget::~SignalTarget() {
  target.store(nullptr);
  while (handlers_using_target.load() != 0) std::this_thread::yield();
}

}  // namespace wrenchd
