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

/// Thread that writes reports for a thread that must not wait. The kernel may block a write for seconds if
/// the device accepts no data (5 s on hidraw). The servo thread stores the newest report in a slot and
/// continues.
///
/// If the servo loop hangs, this thread sends zero commands (LinkSettings::host_watchdog).
///
/// On every kind of close, the last submitted report is also the last one written. A caller that releases the
/// device before closing can rely on zeros being the last command.
class LatestWriter {
 public:
  /// Writes one report and returns the result. May block. Only the writer thread calls it. It is destroyed
  /// after the last write, which may be after the destruction of the LatestWriter (see close()).
  using Write = std::function<LinkStatus(std::span<const std::uint8_t>)>;

  /// Starts the thread. Throws std::system_error if the system cannot create a thread.
  LatestWriter(Write write, const LinkSettings& settings);
  /// Calls close(). Not RT-safe: waits.
  ~LatestWriter();
  LatestWriter(const LatestWriter&) = delete;
  LatestWriter& operator=(const LatestWriter&) = delete;

  /// Submits a report, see WriteSlot::submit(). RT-safe.
  LinkStatus submit(TimePoint now, std::span<const std::uint8_t> report) noexcept;
  /// Writes the waiting report and ends the thread. Takes at most `close_timeout`. Returns true if all
  /// reports were written.
  ///
  /// If the kernel does not return from a write in this time, close() detaches the thread. The thread writes
  /// the last report as soon as it can and then ends. close() then returns false, and also if the last write
  /// failed. A second call returns the same result at once. No other thread may call submit() any more. Not
  /// RT-safe: waits.
  bool close() noexcept;

  /// False if the kernel rejected the requested real-time priority; then raise the rtprio limit.
  bool priority_granted() const noexcept { return priority_granted_; }
  const WriteSlot& slot() const noexcept;

 private:
  struct SharedState;  ///< state of the thread, which the thread keeps alive until it ends

  std::shared_ptr<SharedState> shared_;
  std::thread thread_;
  Duration close_timeout_;
  bool priority_granted_ = true;
  bool written_ = true;  ///< result of close()
};

/// Sets a thread to SCHED_FIFO with this priority; 0 leaves the thread unchanged. Returns false if the kernel
/// rejects the request. Not RT-safe: system call.
bool raise_priority(std::thread& thread, int priority) noexcept;

}  // namespace wrenchd
