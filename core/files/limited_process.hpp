// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include <sys/types.h>

namespace wrenchd {

// Child processes that read files with foreign libraries. A damaged or hostile file then ends the child and
// nothing else.

/// True under a sanitizer. A sanitizer needs terabytes of address space and opens pipes for its checks, so
/// that a child has neither a limit of address space nor a filter of system calls.
extern const bool kSanitized;

/// Sets both limits of a resource (RLIMIT_...) of this process. Not RT-safe: system call.
void limit_resource(int resource, std::uint64_t most) noexcept;

/// Returns the address space of this process [bytes]. Not RT-safe: reads a file.
std::uint64_t address_space_bytes() noexcept;

/// Restricts this process to reading and writing what it has open: it can open no file, start no process and
/// use no network. All other system calls fail with EPERM. Without seccomp in the kernel the limits of
/// resources remain. Not RT-safe: system calls.
void restrict_system_calls() noexcept;

/// Prepares a child process that reads a file and writes its result to a pipe. The file becomes descriptor 3,
/// the pipe descriptor 4, and all descriptors above are closed. The child dies with its parent, has no signal
/// handlers, writes no core and no file, and may use this processor time. Not RT-safe: system calls.
void begin_limited_child(int file, int pipe, std::uint64_t cpu_s) noexcept;
inline constexpr int kChildFile = 3, kChildPipe = 4;

/// A child process, as its parent sees it. The destructor ends it. Not RT-safe: system calls.
class LimitedChild {
 public:
  explicit LimitedChild(pid_t pid) noexcept;
  ~LimitedChild();
  LimitedChild(const LimitedChild&) = delete;
  LimitedChild& operator=(const LimitedChild&) = delete;

  double cpu_s() const noexcept;  ///< processor time that the child has used; 0 if unknown

 private:
  pid_t pid_;
  clockid_t clock_{};
};

}  // namespace wrenchd
