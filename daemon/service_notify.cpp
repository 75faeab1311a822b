// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/service_notify.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include <systemd/sd-daemon.h>

namespace wrenchd {
namespace {

/// Longest time between two messages.
constexpr auto kPeriod = std::chrono::milliseconds(100);
/// Messages within the watchdog time of the service manager. This thread has no real-time priority, so some
/// messages may be late on a busy machine.
constexpr int kMessagesPerWatchdog = 8;

/// A line feed would start another variable of the service manager's protocol.
std::string to_one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; }, ' ');
  return text;
}

std::chrono::microseconds message_period() {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) <= 0) return kPeriod;
  return std::min<std::chrono::microseconds>(kPeriod,
                                             std::chrono::microseconds(watchdog_us / kMessagesPerWatchdog));
}

}  // namespace

std::string status_text(const LoopStatus& loop, const std::string& device) {
  std::string text = name(loop.state);
  if (loop.cause != Fault::none) {
    const FaultRow& row = fault_row(loop.cause);
    text += ": " + std::string(row.name) + ": " + std::string(row.message) + "; " + std::string(row.cure);
  }
  return to_one_line(text + "; device " + device);
}

void ServiceReport::waiting(std::string reason) {
  phase_ = Phase::waiting;
  detail_ = std::move(reason);
  last_ticks_.reset();
}

void ServiceReport::running(std::string device) {
  phase_ = Phase::running;
  detail_ = std::move(device);
  last_ticks_.reset();
}

void ServiceReport::stopping(std::string reason) {
  if (phase_ != Phase::stopping) pending_ += "STOPPING=1\n";
  phase_ = Phase::stopping;
  detail_ = std::move(reason);
}

void ServiceReport::reloading(std::uint64_t monotonic_us) {
  pending_ += "RELOADING=1\nMONOTONIC_USEC=" + std::to_string(monotonic_us) + "\n";
}

void ServiceReport::reloaded() {
  pending_ += "READY=1\n";
}

std::string ServiceReport::next_message(const std::optional<LoopStatus>& loop) {
  std::string status;
  bool ready = ready_sent_, alive = true;
  switch (phase_) {
    case Phase::starting:
      status = "starting";
      alive = false;  // the watchdog starts with READY=1
      break;
    case Phase::waiting:
      status = to_one_line("waiting: " + detail_);
      ready = true;
      break;
    case Phase::running:
      if (!loop) break;  // the loop has just ended
      status = to_one_line(status_text(*loop, detail_));
      ready = ready || (loop->state != State::disconnected && loop->state != State::self_test);
      alive = last_ticks_ != loop->ticks;
      last_ticks_ = loop->ticks;
      break;
    case Phase::stopping:
      status = to_one_line(detail_);
      break;
  }
  std::string text = std::exchange(pending_, {});
  if (ready && !std::exchange(ready_sent_, ready)) text += "READY=1\n";
  if (alive && ready_sent_) text += "WATCHDOG=1\n";
  if (!status.empty() && status != last_status_) text += "STATUS=" + status + "\n";
  if (!status.empty()) last_status_ = status;
  return text;
}

ServiceNotify::ServiceNotify() : enabled_(std::getenv("NOTIFY_SOCKET") != nullptr) {
  if (!enabled_) return;
  thread_ = std::jthread([this, period = message_period()](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    do {
      send_report();
    } while (!changed_.wait_for(lock, stop, period, [&stop] { return stop.stop_requested(); }));
  });
}

ServiceNotify::~ServiceNotify() {
  thread_ = {};  // join first: the thread uses the other members
}

void ServiceNotify::waiting(const std::string& reason) {
  update([&] {
    read_loop_status_ = nullptr;
    report_.waiting(reason);
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

void ServiceNotify::stopping(const std::string& reason) {
  update([&] {
    read_loop_status_ = nullptr;
    report_.stopping(reason);
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

/// Precondition: mutex_ is locked.
void ServiceNotify::send_report() {
  const std::string text =
      report_.next_message(read_loop_status_ ? std::optional(read_loop_status_()) : std::nullopt);
  if (!text.empty()) sd_notify(0, text.c_str());
}

}  // namespace wrenchd
