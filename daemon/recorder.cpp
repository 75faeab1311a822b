// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recorder.hpp"

#include <chrono>

namespace wrenchd {
namespace {

constexpr auto kPause = std::chrono::milliseconds(100);

}  // namespace

Recorder::Recorder(RecordRing& ring, const std::filesystem::path& file, const RecordingHeader& header)
    : ring_(ring),
      writer_(file, header),
      batch_(kRingRecords),
      thread_([this](const std::stop_token& s) { run(s); }) {}

Recorder::~Recorder() {
  thread_.request_stop();
  thread_.join();
}

std::string Recorder::error() const {
  return failed_.load(std::memory_order_acquire) ? error_ : std::string();
}

void Recorder::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    drain();
    std::this_thread::sleep_for(kPause);
  }
  drain();
}

void Recorder::drain() {
  const std::size_t count = ring_.pop(batch_.data(), batch_.size());
  if (count == 0 || failed_.load(std::memory_order_relaxed)) return;
  try {
    writer_.append(std::span(batch_).first(count));
    written_.fetch_add(count, std::memory_order_relaxed);
  } catch (const RecordingError& error) {
    error_ = error.what();
    failed_.store(true, std::memory_order_release);
  }
}

}  // namespace wrenchd
