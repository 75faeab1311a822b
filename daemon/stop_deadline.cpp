// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/stop_deadline.hpp"

#include <utility>

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/process_signals.hpp"

namespace wrenchd {
namespace {

constexpr auto kCheckPeriod = std::chrono::milliseconds(20);

}  // namespace

StopDeadline::StopDeadline(const ProcessSignals& signals, std::function<void()> before_exit)
    : signals_(signals), before_exit_(std::move(before_exit)), thread_([this](const std::stop_token& stop) {
        pthread_setname_np(pthread_self(), "stop deadline");
        run(stop);
      }) {}

StopDeadline::~StopDeadline() {
  thread_.request_stop();
  thread_.join();
}

/// The time without a recording and the time with one count separately.
void StopDeadline::run(const std::stop_token& stop) {
  std::chrono::steady_clock::duration used{0}, used_recording{0};
  auto last = std::chrono::steady_clock::now();
  for (; !stop.stop_requested(); std::this_thread::sleep_for(kCheckPeriod)) {
    const auto now = std::chrono::steady_clock::now();
    const auto passed = now - std::exchange(last, now);
    if (!started_.load() && !signals_.stop_requested()) continue;
    (recordings_.load() > 0 ? used_recording : used) += passed;
    if (used < kMaxStop && used_recording < kMaxRecording) continue;
    release_hand_before_exit();
    spdlog::warn("{}; wrenchd ends without waiting for it",
                 used < kMaxStop ? "a recording is not written yet" : "unfinished work delays the end");
    before_exit_();
    ::_exit(exit_code_.load());
  }
}

}  // namespace wrenchd
