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

std::string status_text(const LoopStatus& loop, const std::string& device) {
  std::string text = name(loop.state);
  if (loop.cause != Fault::none) {
    const FaultRow& row = fault_row(loop.cause);
    text += ": " + std::string(row.name) + ": " + std::string(row.message) + "; " + std::string(row.cure);
  }
  return in_one_line(text + "; device " + device);
}

void ServiceReport::waiting(std::string why) {
  phase_ = Phase::waiting;
  detail_ = std::move(why);
  last_ticks_.reset();
}

void ServiceReport::running(std::string device) {
  phase_ = Phase::running;
  detail_ = std::move(device);
  last_ticks_.reset();
}

void ServiceReport::stopping(std::string words) {
  if (phase_ != Phase::stopping) pending_ += "STOPPING=1\n";
  phase_ = Phase::stopping;
  detail_ = std::move(words);
}

void ServiceReport::reloading(std::uint64_t monotonic_us) {
  pending_ += "RELOADING=1\nMONOTONIC_USEC=" + std::to_string(monotonic_us) + "\n";
}

void ServiceReport::reloaded() {
  pending_ += "READY=1\n";
}

std::string ServiceReport::next_message(const std::optional<LoopStatus>& loop) {
  std::string words;
  bool ready = ready_sent_, alive = true;
  switch (phase_) {
    case Phase::starting:
      words = "starting";
      alive = false;  // the manager does not watch before it is ready
      break;
    case Phase::waiting:
      words = in_one_line("waiting: " + detail_);
      ready = true;
      break;
    case Phase::running:
      if (!loop) break;  // it has just ended
      words = status_text(*loop, detail_);
      ready = ready || (loop->state != State::disconnected && loop->state != State::self_test);
      alive = last_ticks_ != loop->ticks;
      last_ticks_ = loop->ticks;
      break;
    case Phase::stopping:
      words = in_one_line(detail_);
      break;
  }
  std::string text = std::exchange(pending_, {});
  if (ready && !std::exchange(ready_sent_, ready)) text += "READY=1\n";
  if (alive && ready_sent_) text += "WATCHDOG=1\n";
  if (!words.empty() && words != last_status_) text += "STATUS=" + words + "\n";
  if (!words.empty()) last_status_ = words;
  return text;
}

ServiceNotify::ServiceNotify() : enabled_(std::getenv("NOTIFY_SOCKET") != nullptr) {
  if (!enabled_) return;
  thread_ = std::jthread([this, period = look_period()](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    do {
      send_report();
    } while (!changed_.wait_for(lock, stop, period, [&stop] { return stop.stop_requested(); }));
  });
}

ServiceNotify::~ServiceNotify() {
  thread_ = {};  // what was said last has been sent
}

void ServiceNotify::waiting(const std::string& why) {
  update([&] {
    read_loop_status_ = nullptr;
    report_.waiting(why);
  });
}

void ServiceNotify::running(ReadLoopStatus loop, const std::string& device) {
  update([&] {
    read_loop_status_ = std::move(loop);
    report_.running(device);
  });
}

void ServiceNotify::loop_ended() noexcept {
  const std::lock_guard lock(mutex_);
  read_loop_status_ = nullptr;
}

void ServiceNotify::stopping(const std::string& words) {
  update([&] {
    read_loop_status_ = nullptr;
    report_.stopping(words);
  });
}

void ServiceNotify::reloading() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();  // CLOCK_MONOTONIC
  update([&] {
    report_.reloading(
        static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(now).count()));
  });
}

void ServiceNotify::reloaded() {
  update([&] { report_.reloaded(); });
}

void ServiceNotify::update(const std::function<void()>& change) {
  if (!enabled_) return;
  const std::lock_guard lock(mutex_);
  change();
  send_report();
}

/// Under mutex_.
void ServiceNotify::send_report() {
  const std::string text =
      report_.next_message(read_loop_status_ ? std::optional(read_loop_status_()) : std::nullopt);
  if (!text.empty()) sd_notify(0, text.c_str());
}

}  // namespace wrenchd
