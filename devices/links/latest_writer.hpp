// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <thread>

#include "core/clock.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"
#include "devices/links/write_slot.hpp"

namespace wrenchd {

/// A thread that writes reports for one that must not wait. The kernel may keep a write for seconds where the
/// device takes nothing (5 s on hidraw), so it is done here; the servo thread leaves the newest report in a
/// slot and goes on.
///
/// A loop that falls silent while it pushes is spoken for, as LinkSettings::last_word says: this thread lives
/// on where that one is stuck.
///
/// Every end is the same: the report handed over last is written last, and nothing after it. Who releases the
/// hand before it closes can rely on zeros being the last word.
class LatestWriter {
 public:
  /// Writes one report and says how it went. May block; called on the writer's thread only, and destroyed
  /// when the last write is over, which may be after the writer itself (see close()).
  using Write = std::function<LinkStatus(std::span<const std::uint8_t>)>;

  /// Starts the thread. Throws std::system_error where the system has none left.
  LatestWriter(Write write, const LinkSettings& settings);
  /// As close().
  ~LatestWriter();
  LatestWriter(const LatestWriter&) = delete;
  LatestWriter& operator=(const LatestWriter&) = delete;

  /// See WriteSlot::hand_over(). RT safe.
  LinkStatus submit(TimePoint now, std::span<const std::uint8_t> report) noexcept;
  /// Writes what waits and ends the thread, in `close_within` at most. True where all was written.
  ///
  /// Where the kernel does not give a write back in that time the thread is left alone with it: it still
  /// writes the last report once it can, then ends by itself. False then, and where the write failed. Not RT
  /// safe; to be called when nobody hands over any more.
  bool close() noexcept;

  /// False where a real-time priority was asked for and the kernel refused: raise the rtprio limit.
  bool priority_granted() const noexcept { return priority_granted_; }
  const WriteSlot& slot() const noexcept;

 private:
  struct SharedState;  ///< what the thread needs, kept by it until it ends

  std::shared_ptr<SharedState> shared_;
  std::thread thread_;
  Duration close_timeout_;
  bool priority_granted_ = true;
};

/// Makes a thread SCHED_FIFO of that priority, or leaves it as it is where that is 0. False where the kernel
/// refuses.
bool raise_priority(std::thread& thread, int priority) noexcept;

}  // namespace wrenchd
