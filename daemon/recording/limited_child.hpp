// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

namespace wrenchd {

/// Limits of a child process.
struct ChildLimits {
  double cpu_s = 1.0;              ///< processor time
  double wall_s = 60.0;            ///< time without a byte from the child
  std::uint64_t memory_bytes = 0;  ///< memory beyond that of the parent
};

/// How a child has ended.
struct ChildEnd {
  bool out_of_time = false;
  int signal = 0;  ///< signal that ended the child; 0: none, or not known
};

/// Forks a child that calls work(), and passes what work() writes to receive(), until receive() returns false
/// or the child ends. The child has no descriptor but its end of a pipe, cannot open files, start programs or
/// connect (seccomp, where the kernel permits it), and dies with the parent. What it does to its memory does
/// not concern the parent. work: gets a function that writes to the pipe; must not use locks that other
/// threads of the parent may hold. An exception of receive() ends the child, and is passed on. Not RT-safe:
/// copies the page tables, and waits.
ChildEnd run_limited_child(
    const ChildLimits& limits,
    const std::function<void(const std::function<void(std::string_view)>& write)>& work,
    const std::function<bool(std::string_view)>& receive);

}  // namespace wrenchd
