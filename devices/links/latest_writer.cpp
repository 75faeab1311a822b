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

struct LatestWriter::Work {
  Work(Write how, const LinkSettings& settings)
      : write(std::move(how)), slot(settings.write_deadline), last_word(settings.last_word) {}

  void run() noexcept;
  bool next(Packet& packet) noexcept;
  void write_one(const Packet& packet) noexcept;

  Write write;
  WriteSlot slot;
  LastWord last_word;
  WakeUp wake;
  std::atomic<bool> closing{false};

  std::mutex mutex;
  std::condition_variable changed;
  bool over = false;    ///< under the mutex
  bool last_ok = true;  ///< the last write succeeded; the thread's, to be read when it is over
};

void LatestWriter::Work::run() noexcept {
  // Whether it is the end is asked before the slot is: what was handed over before the end is then seen.
  for (bool last_round = false; !slot.gone() && !last_round;) {
    last_round = closing.load(std::memory_order_acquire);
    Packet packet;
    if (next(packet)) {
      write_one(packet);
      last_round = false;
    } else if (!last_round) {
      wake.sleep_until(last_word.due());
    }
  }
  const std::lock_guard lock(mutex);
  over = true;
  changed.notify_all();
}

/// What the loop handed over, or what is said in its place.
bool LatestWriter::Work::next(Packet& packet) noexcept {
  const bool heard = slot.take(packet);
  const TimePoint now = std::chrono::steady_clock::now();
  if (heard) last_word.heard(now, packet);
  return heard || last_word.speak(now, packet);
}

void LatestWriter::Work::write_one(const Packet& packet) noexcept {
  LinkStatus status = LinkStatus::empty;
  try {
    status = write(packet.report());
  } catch (...) {  // a write that throws is a write that failed
  }
  last_ok = status == LinkStatus::ok;
  slot.end(status);
}

LatestWriter::LatestWriter(Write write, const LinkSettings& settings)
    : work_(std::make_shared<Work>(std::move(write), settings)),
      thread_([work = work_] { work->run(); }),
      close_within_(settings.close_within),
      priority_granted_(raise_priority(thread_, settings.priority)) {
  pthread_setname_np(thread_.native_handle(), "wrenchd-writer");
}

LatestWriter::~LatestWriter() {
  close();
}

LinkStatus LatestWriter::hand_over(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  const LinkStatus status = work_->slot.hand_over(now, report);
  if (status != LinkStatus::gone) work_->wake.wake();
  return status;
}

bool LatestWriter::close() noexcept {
  work_->closing.store(true, std::memory_order_release);
  work_->wake.wake();
  std::unique_lock lock(work_->mutex);
  const bool over = work_->changed.wait_for(lock, close_within_, [this] { return work_->over; });
  lock.unlock();
  if (thread_.joinable()) over ? thread_.join() : thread_.detach();
  return over && work_->last_ok;
}

const WriteSlot& LatestWriter::slot() const noexcept {
  return work_->slot;
}

bool raise_priority(std::thread& thread, int priority) noexcept {
  if (priority == 0) return true;
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters) == 0;
}

}  // namespace wrenchd
