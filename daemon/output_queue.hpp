// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>

namespace wrenchd {

/// Runs output, such as writing a log line, on a thread of its own and in order. A terminal, a pipe or the
/// journal whose reader stops reading blocks that thread only.
///
/// The queue is bounded. While it is full, new outputs are dropped and counted; what is queued stays, so that
/// the log shows how a problem began. Any thread except the servo thread. Not RT-safe: allocates, locks for
/// the time of one copy.
class OutputQueue {
 public:
  using Output = std::function<void()>;
  /// Receives the number of outputs that were dropped since its last call. Runs on the thread of the queue,
  /// in the place of the dropped outputs.
  using ReportDropped = std::function<void(std::uint64_t count)>;

  /// The thread starts with the first output.
  explicit OutputQueue(ReportDropped report_dropped = {});
  /// Calls close().
  ~OutputQueue();
  OutputQueue(const OutputQueue&) = delete;
  OutputQueue& operator=(const OutputQueue&) = delete;

  /// Queues an output that holds this number of bytes. Does not wait for other outputs, and throws nothing:
  /// if there is no memory or no thread, the output is dropped.
  void post(std::size_t bytes, Output output) noexcept;

  /// Waits until all outputs have run, and ends the thread. Gives up if no output ends within kStall: the
  /// thread is then left behind in its output. Drops all later outputs. Returns false if outputs are left.
  bool close() noexcept;

  /// Number of outputs that were dropped so far.
  std::uint64_t dropped() const noexcept;

  static constexpr std::size_t kMaxOutputs = 4096;
  static constexpr std::size_t kMaxBytes = std::size_t{1} << 20;
  static constexpr auto kStall = std::chrono::milliseconds(300);

 private:
  struct State;
  std::shared_ptr<State> state_;  ///< shared with the thread, which may outlive this object
  std::thread thread_;            ///< protected by the mutex of state_
};

}  // namespace wrenchd
