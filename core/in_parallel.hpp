// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <future>
#include <system_error>
#include <thread>
#include <vector>

namespace wrenchd {

/// Returns how many threads are worth their start for this amount of work: at most one for each
/// `least_per_thread`, at most one for each processor, and at least one.
inline std::size_t threads_for(std::size_t amount, std::size_t least_per_thread) {
  const std::size_t processors = std::max(std::thread::hardware_concurrency(), 1U);
  return std::clamp<std::size_t>(amount / least_per_thread, 1, processors);
}

/// Calls work(i) once for each i in [0, count), on up to `threads` threads, one of which is the caller's.
/// Each thread gets consecutive numbers. The calls must not depend on each other. An exception of a call is
/// thrown here, after all threads have ended. Not RT-safe: starts threads.
template <class Work>
void in_parallel(std::size_t count, std::size_t threads, const Work& work) {
  const std::size_t parts = std::clamp<std::size_t>(count, 1, threads);
  const auto run = [&](std::size_t part) {
    for (std::size_t i = part * count / parts; i < (part + 1) * count / parts; ++i) work(i);
  };
  std::vector<std::future<void>> others;  // the destructor of each future waits for its thread
  std::size_t part = 1;
  try {
    for (; part < parts; ++part) others.push_back(std::async(std::launch::async, run, part));
  } catch (const std::system_error&) {
    for (; part < parts; ++part) run(part);
  }
  run(0);
  for (std::future<void>& other : others) other.get();
}

}  // namespace wrenchd
