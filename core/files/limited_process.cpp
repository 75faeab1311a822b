// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/files/limited_process.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <ctime>

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace wrenchd {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
const bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
const bool kSanitized = true;
#else
const bool kSanitized = false;
#endif
#else
const bool kSanitized = false;
#endif

void limit_resource(int resource, std::uint64_t most) noexcept {
  const rlimit both = {most, most};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

std::uint64_t address_space_bytes() noexcept {
  unsigned long pages = 0;
  if (std::FILE* const file = std::fopen("/proc/self/statm", "re")) {
    if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return std::uint64_t{pages} * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

void restrict_system_calls() noexcept {
#if defined(__x86_64__)
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
  constexpr std::uint32_t kArchitecture = 0;
#endif
  constexpr std::array kAllowed = {
      SYS_read,        SYS_pread64,     SYS_readv,         SYS_lseek,          SYS_fstat,  SYS_newfstatat,
      SYS_write,       SYS_writev,      SYS_close,         SYS_mmap,           SYS_munmap, SYS_mremap,
      SYS_mprotect,    SYS_madvise,     SYS_brk,           SYS_futex,          SYS_flock,  SYS_fcntl,
      SYS_exit,        SYS_exit_group,  SYS_rt_sigreturn,  SYS_rt_sigprocmask, SYS_getpid, SYS_gettid,
      SYS_tgkill,      SYS_getrandom,   SYS_clock_gettime, SYS_sched_yield,    SYS_getcwd, SYS_rt_sigaction,
      SYS_sigaltstack, SYS_gettimeofday};
  if (kArchitecture == 0) return;
  std::array<sock_filter, kAllowed.size() + 6> program{};
  std::size_t n = 0;
  program[n++] = BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch));
  program[n++] = BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0);
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
  program[n++] = BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));
  for (std::size_t i = 0; i < kAllowed.size(); ++i)
    program[n++] = BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(kAllowed[i]),
                            static_cast<std::uint8_t>(kAllowed.size() - i), 0);
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  const sock_fprog filter{static_cast<unsigned short>(n), program.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0) ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter);
}

void begin_limited_child(int file, int pipe, std::uint64_t cpu_s) noexcept {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGPIPE, SIGXCPU, SIGTERM, SIGINT})
    ::signal(signal, SIG_DFL);
  // The numbers may collide, so both move out of the way first.
  const int file_copy = ::fcntl(file, F_DUPFD, 10), pipe_copy = ::fcntl(pipe, F_DUPFD, 10);
  if (file_copy < 0 || pipe_copy < 0 || ::dup2(file_copy, kChildFile) < 0 ||
      ::dup2(pipe_copy, kChildPipe) < 0)
    ::_exit(1);
  ::syscall(SYS_close_range, kChildPipe + 1, ~0U, 0);
  limit_resource(RLIMIT_CORE, 0);
  limit_resource(RLIMIT_FSIZE, 0);
  limit_resource(RLIMIT_CPU, cpu_s);
}

LimitedChild::LimitedChild(pid_t pid) noexcept : pid_(pid) {
  if (::clock_getcpuclockid(pid, &clock_) != 0) clock_ = CLOCK_MONOTONIC;
}

LimitedChild::~LimitedChild() {
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

double LimitedChild::cpu_s() const noexcept {
  timespec used{};
  if (clock_ == CLOCK_MONOTONIC || ::clock_gettime(clock_, &used) != 0) return 0.0;
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

}  // namespace wrenchd
