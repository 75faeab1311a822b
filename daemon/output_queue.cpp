// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/output_queue.hpp"

#include <condition_variable>
#include <csignal>
#include <deque>
#include <mutex>
#include <utility>

#include <pthread.h>

namespace wrenchd {

struct OutputQueue::State {
  struct Entry {
    std::size_t bytes;
    Output output;
  };

  explicit State(ReportDropped report) : report_dropped(std::move(report)) {}
  void run();
  static void call(const Output& output) noexcept;

  const ReportDropped report_dropped;
  std::mutex mutex;  ///< protects the members below
  std::condition_variable changed;
  std::deque<Entry> entries;
  std::size_t bytes = 0;        ///< sum of the bytes of all entries
  std::uint64_t dropped = 0;    ///< since the start
  std::uint64_t reported = 0;   ///< dropped outputs that report_dropped has received
  std::uint64_t completed = 0;  ///< outputs that have run
  bool running = false;         ///< an output runs
  bool closing = false;         ///< no more outputs are accepted
  bool ending = false;          ///< the thread has to end
};

void OutputQueue::State::call(const Output& output) noexcept try {
  output();
} catch (...) {  // a line that cannot be written has no other place to go
}

void OutputQueue::State::run() {
  // A signal would interrupt a write. Other threads handle it.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  pthread_setname_np(pthread_self(), "output");
  std::unique_lock lock(mutex);
  while (true) {
    changed.wait(lock, [this] { return ending || !entries.empty() || dropped > reported; });
    if (entries.empty() && dropped == reported) return;
    Output output;
    if (entries.empty()) {  // the dropped ones came after all that is queued
      output = [this, count = dropped - std::exchange(reported, dropped)] {
        if (report_dropped) report_dropped(count);
      };
    } else {
      output = std::move(entries.front().output);
      bytes -= entries.front().bytes;
      entries.pop_front();
    }
    running = true;
    lock.unlock();
    call(output);
    output = nullptr;
    lock.lock();
    running = false;
    ++completed;
    changed.notify_all();
  }
}

OutputQueue::OutputQueue(ReportDropped report_dropped)
    : state_(std::make_shared<State>(std::move(report_dropped))) {}

OutputQueue::~OutputQueue() {
  close();
}

void OutputQueue::post(std::size_t bytes, Output output) noexcept {
  const std::lock_guard lock(state_->mutex);
  State& state = *state_;
  // While a report of dropped outputs is due, later ones wait for it: the log keeps its order.
  const bool full = state.entries.size() >= kMaxOutputs || state.bytes + bytes > kMaxBytes ||
                    state.dropped > state.reported;
  if (state.closing) return;
  try {
    if (full) {
      ++state.dropped;
    } else {
      if (!thread_.joinable()) thread_ = std::thread([shared = state_] { shared->run(); });
      state.entries.push_back({bytes, std::move(output)});
      state.bytes += bytes;
    }
  } catch (...) {
    ++state.dropped;
  }
  state.changed.notify_all();
}

bool OutputQueue::close() noexcept {
  std::unique_lock lock(state_->mutex);
  State& state = *state_;
  state.closing = true;
  const auto done = [&state] {
    return state.entries.empty() && !state.running && state.dropped == state.reported;
  };
  while (thread_.joinable() && !done()) {
    const std::uint64_t before = state.completed;
    if (!state.changed.wait_for(lock, kStall, [&] { return done() || state.completed != before; })) break;
  }
  state.ending = true;
  const bool complete = done();
  if (!complete) state.entries.clear(), state.reported = state.dropped;
  std::thread thread = std::move(thread_);
  lock.unlock();
  state.changed.notify_all();
  if (thread.joinable()) complete ? thread.join() : thread.detach();
  return complete;
}

std::uint64_t OutputQueue::dropped() const noexcept {
  const std::lock_guard lock(state_->mutex);
  return state_->dropped;
}

}  // namespace wrenchd
