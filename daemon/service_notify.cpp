// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/service_notify.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include <systemd/sd-daemon.h>

namespace wrenchd {
namespace {

/// How often the loop is looked at, unless the watchdog wants it oftener.
constexpr auto kLook = std::chrono::milliseconds(100);
/// Looks within the time after which the manager takes a silent service for dead: an ordinary thread on a
/// busy machine may come late to some of them.
constexpr int kLooksInWatchdog = 8;

std::string in_one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::chrono::microseconds look_period() {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) <= 0) return kLook;
  return std::min<std::chrono::microseconds>(kLook,
                                             std::chrono::microseconds(watchdog_us / kLooksInWatchdog));
}

}  // namespace

std::string status_text(const LoopView& loop, const std::string& device) {
  std::string text = name(loop.state);
  if (loop.cause != Fault::none) {
    const FaultRow& row = fault_row(loop.cause);
    text += ": " + std::string(row.name) + ": " + std::string(row.sentence) + "; " + std::string(row.cure);
  }
  return in_one_line(text + "; device " + device);
}

void ServiceReport::waiting(std::string why) {
  phase_ = Phase::waiting;
  words_ = std::move(why);
  ticks_.reset();
}

void ServiceReport::running(std::string device) {
  phase_ = Phase::running;
  words_ = std::move(device);
  ticks_.reset();
}

void ServiceReport::stopping(std::string words) {
  if (phase_ != Phase::stopping) next_ += "STOPPING=1\n";
  phase_ = Phase::stopping;
  words_ = std::move(words);
}

void ServiceReport::reloading(std::uint64_t monotonic_us) {
  next_ += "RELOADING=1\nMONOTONIC_USEC=" + std::to_string(monotonic_us) + "\n";
}

void ServiceReport::reloaded() {
  next_ += "READY=1\n";
}

std::string ServiceReport::look(const std::optional<LoopView>& loop) {
  std::string words;
  bool ready = ready_, alive = true;
  switch (phase_) {
    case Phase::starting:
      words = "starting";
      alive = false;  // the manager does not watch before it is ready
      break;
    case Phase::waiting:
      words = in_one_line("waiting: " + words_);
      ready = true;
      break;
    case Phase::running:
      if (!loop) break;  // it has just ended
      words = status_text(*loop, words_);
      ready = ready || (loop->state != State::disconnected && loop->state != State::self_test);
      alive = ticks_ != loop->ticks;
      ticks_ = loop->ticks;
      break;
    case Phase::stopping:
      words = in_one_line(words_);
      break;
  }
  std::string text = std::exchange(next_, {});
  if (ready && !std::exchange(ready_, ready)) text += "READY=1\n";
  if (alive && ready_) text += "WATCHDOG=1\n";
  if (!words.empty() && words != said_) text += "STATUS=" + words + "\n";
  if (!words.empty()) said_ = words;
  return text;
}

ServiceNotify::ServiceNotify() : wanted_(std::getenv("NOTIFY_SOCKET") != nullptr) {
  if (!wanted_) return;
  thread_ = std::jthread([this, period = look_period()](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    do {
      look();
    } while (!changed_.wait_for(lock, stop, period, [&stop] { return stop.stop_requested(); }));
  });
}

ServiceNotify::~ServiceNotify() {
  thread_ = {};  // what was said last has been sent
}

void ServiceNotify::waiting(const std::string& why) {
  tell([&] {
    loop_ = nullptr;
    report_.waiting(why);
  });
}

void ServiceNotify::running(Look loop, const std::string& device) {
  tell([&] {
    loop_ = std::move(loop);
    report_.running(device);
  });
}

void ServiceNotify::loop_ended() noexcept {
  const std::lock_guard lock(mutex_);
  loop_ = nullptr;
}

void ServiceNotify::stopping(const std::string& words) {
  tell([&] {
    loop_ = nullptr;
    report_.stopping(words);
  });
}

void ServiceNotify::reloading() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();  // CLOCK_MONOTONIC
  tell([&] {
    report_.reloading(
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(now).count()));
  });
}

void ServiceNotify::reloaded() {
  tell([&] { report_.reloaded(); });
}

void ServiceNotify::tell(const std::function<void()>& change) {
  if (!wanted_) return;
  const std::lock_guard lock(mutex_);
  change();
  look();
}

/// Under mutex_.
void ServiceNotify::look() {
  const std::string text = report_.look(loop_ ? std::optional(loop_()) : std::nullopt);
  if (!text.empty()) sd_notify(0, text.c_str());
}

}  // namespace wrenchd
