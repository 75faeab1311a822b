// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/latest_writer.hpp"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <utility>

#include <pthread.h>
#include <sched.h>

#include "devices/links/wake_up.hpp"

namespace wrenchd {

struct LatestWriter::SharedState {
  SharedState(Write how, const LinkSettings& settings)
      : write(std::move(how)), slot(settings.write_deadline), host_watchdog(settings.host_watchdog) {}

  void run() noexcept;
  bool next(Packet& packet) noexcept;
  void write_one(const Packet& packet) noexcept;

  Write write;
  WriteSlot slot;
  HostWatchdog host_watchdog;
  WakeUp wake;
  std::atomic<bool> closing{false};

  std::mutex mutex;
  std::condition_variable changed;
  bool ended = false;   ///< guarded by the mutex
  bool last_ok = true;  ///< result of the last write; written by the thread, read after it has ended
};

void LatestWriter::SharedState::run() noexcept {
  // Reads `closing` before the slot, so that every report submitted before close() is written.
  for (bool last_round = false; !slot.disconnected() && !last_round;) {
    last_round = closing.load(std::memory_order_acquire);
    Packet packet;
    if (next(packet)) {
      write_one(packet);
      last_round = false;
    } else if (!last_round) {
      wake.wait_until(host_watchdog.due());
    }
  }
  const std::lock_guard lock(mutex);
  ended = true;
  changed.notify_all();
}

/// Returns the next report: of the servo loop, or of the host watchdog.
bool LatestWriter::SharedState::next(Packet& packet) noexcept {
  const bool has_report = slot.take(packet);
  const TimePoint now = std::chrono::steady_clock::now();
  if (has_report) host_watchdog.feed(now, packet);
  return has_report || host_watchdog.send_zero(now, packet);
}

void LatestWriter::SharedState::write_one(const Packet& packet) noexcept {
  LinkStatus status = LinkStatus::not_ready;
  try {
    status = write(packet.report());
  } catch (...) {  // a write that throws counts as failed
  }
  last_ok = status == LinkStatus::ok;
  slot.complete(status);
}

LatestWriter::LatestWriter(Write write, const LinkSettings& settings)
    : shared_(std::make_shared<SharedState>(std::move(write), settings)),
      thread_([work = shared_] { work->run(); }),
      close_timeout_(settings.close_timeout),
      priority_granted_(raise_priority(thread_, settings.priority)) {
  pthread_setname_np(thread_.native_handle(), "wrenchd-writer");
}

LatestWriter::~LatestWriter() {
  close();
}

LinkStatus LatestWriter::submit(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  const LinkStatus status = shared_->slot.submit(now, report);
  if (status != LinkStatus::disconnected) shared_->wake.wake();
  return status;
}

bool LatestWriter::close() noexcept {
  if (!thread_.joinable()) return written_;  // a second call, such as the destructor's, does not wait again
  shared_->closing.store(true, std::memory_order_release);
  shared_->wake.wake();
  std::unique_lock lock(shared_->mutex);
  const bool ended = shared_->changed.wait_for(lock, close_timeout_, [this] { return shared_->ended; });
  lock.unlock();
  ended ? thread_.join() : thread_.detach();
  written_ = ended && shared_->last_ok;
  return written_;
}

const WriteSlot& LatestWriter::slot() const noexcept {
  return shared_->slot;
}

bool raise_priority(std::thread& thread, int priority) noexcept {
  if (priority == 0) return true;
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters) == 0;
}

}  // namespace wrenchd
