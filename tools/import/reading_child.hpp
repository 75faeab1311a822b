// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace wrenchd {

/// What a child process that reads a foreign file may use.
struct ReadingLimits {
  double cpu_s = 600.0;
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  ///< beside what the parent uses
  std::uint64_t answer_bytes = std::uint64_t{2} << 30;
};

/// Runs `read` in a child process that can open no file, start no process and use no network, and returns its
/// result. library: for messages. Throws ImportError: the one that `read` throws, or a reason with its remedy
/// if the child crashes or exceeds a limit. Not RT-safe: starts a process.
std::string read_in_child(const std::string& library, const ReadingLimits& limits,
                          const std::function<std::string()>& read);

}  // namespace wrenchd
