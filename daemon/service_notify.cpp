// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/service_notify.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include <systemd/sd-daemon.h>

#include "daemon/thread_guard.hpp"

namespace wrenchd {
namespace {

/// Longest time between two messages.
constexpr auto kNotifyPeriod = std::chrono::milliseconds(100);
/// Messages within the watchdog time of the service manager. This thread has no real-time priority, so some
/// messages may be late on a busy machine.
constexpr int kMessagesPerWatchdog = 8;

std::string to_one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::chrono::microseconds message_period() {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) <= 0) return kNotifyPeriod;
  return std::min<std::chrono::microseconds>(kNotifyPeriod,
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

void ServiceReport::add_second_hand(std::string name) {
  hands_.push_back({.name = std::move(name), .detail = {}, .last_ticks = {}});
}

void ServiceReport::waiting(std::string reason, std::size_t hand) {
  hands_[hand].phase = Phase::waiting;
  hands_[hand].detail = std::move(reason);
  hands_[hand].last_ticks.reset();
}

void ServiceReport::running(std::string device, std::size_t hand) {
  hands_[hand].phase = Phase::running;
  hands_[hand].detail = std::move(device);
  hands_[hand].last_ticks.reset();
}

void ServiceReport::stopping(std::string reason) {
  if (stop_reason_.empty()) pending_ += "STOPPING=1\n";
  stop_reason_ = std::move(reason);
}

void ServiceReport::reloading(std::uint64_t monotonic_us) {
  pending_ += "RELOADING=1\nMONOTONIC_USEC=" + std::to_string(monotonic_us) + "\n";
}

void ServiceReport::reloaded() {
  pending_ += "READY=1\n";
}

ServiceReport::Part ServiceReport::part_of(Hand& hand, const std::optional<LoopStatus>& loop) const {
  switch (hand.phase) {
    case Phase::starting:
      return {"starting", ready_sent_, false};  // the watchdog starts with READY=1
    case Phase::waiting:
      return {to_one_line("waiting: " + hand.detail), true, true};
    case Phase::running:
      break;
  }
  if (!loop) return {"", ready_sent_, true};  // the loop has just ended
  const bool tested = loop->state != State::disconnected && loop->state != State::self_test;
  const bool ticked = hand.last_ticks != loop->ticks;
  hand.last_ticks = loop->ticks;
  return {status_text(*loop, hand.detail), ready_sent_ || tested, ticked};
}

/// The status names both hands: "disarmed; device a | left: waiting: ...".
ServiceReport::Part ServiceReport::part_of_all(const std::optional<LoopStatus>& loop,
                                               const std::optional<LoopStatus>& second) {
  Part all = part_of(hands_[0], loop);
  if (hands_.size() < 2) return all;
  const Part other = part_of(hands_[1], second);
  const bool news = !all.status.empty() && !other.status.empty();
  return {news ? all.status + " | " + hands_[1].name + ": " + other.status : "", all.ready && other.ready,
          all.alive && other.alive};
}

std::string ServiceReport::next_message(const std::optional<LoopStatus>& loop,
                                        const std::optional<LoopStatus>& second) {
  const Part now =
      stop_reason_.empty() ? part_of_all(loop, second) : Part{to_one_line(stop_reason_), ready_sent_, true};
  std::string text = std::exchange(pending_, {});
  if (now.ready && !std::exchange(ready_sent_, now.ready)) text += "READY=1\n";
  if (now.alive && ready_sent_) text += "WATCHDOG=1\n";
  if (!now.status.empty() && now.status != last_status_) text += "STATUS=" + now.status + "\n";
  if (!now.status.empty()) last_status_ = now.status;
  return text;
}

ServiceNotify::ServiceNotify() : enabled_(std::getenv("NOTIFY_SOCKET") != nullptr) {
  if (!enabled_) return;
  thread_ = std::jthread([this, period = message_period()](const std::stop_token& stop) {
    ThreadGuard guard("notification of the service manager");
    std::unique_lock lock(mutex_);
    do {
      guard.run([this] { send_report(); });
    } while (!changed_.wait_for(lock, stop, period, [&stop] { return stop.stop_requested(); }));
  });
}

ServiceNotify::~ServiceNotify() {
  thread_ = {};  // join first: the thread uses the other members
}

void ServiceNotify::add_second_hand(const std::string& name) {
  update([&] { report_.add_second_hand(name); });
}

void ServiceNotify::waiting(const std::string& reason, std::size_t hand) {
  update([&] {
    read_loop_status_[hand] = nullptr;
    report_.waiting(reason, hand);
  });
}

void ServiceNotify::running(ReadLoopStatus loop, const std::string& device, std::size_t hand) {
  update([&] {
    read_loop_status_[hand] = std::move(loop);
    report_.running(device, hand);
  });
}

void ServiceNotify::loop_ended(std::size_t hand) noexcept {
  const std::lock_guard lock(mutex_);
  read_loop_status_[hand] = nullptr;
}

void ServiceNotify::stopping(const std::string& reason) {
  update([&] {
    read_loop_status_ = {};
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
  const auto status = [](const ReadLoopStatus& read) { return read ? std::optional(read()) : std::nullopt; };
  const std::string text = report_.next_message(status(read_loop_status_[0]), status(read_loop_status_[1]));
  if (!text.empty()) sd_notify(0, text.c_str());
}

}  // namespace wrenchd
