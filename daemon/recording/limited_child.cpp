// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/limited_child.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "files/owned_fd.hpp"

namespace wrenchd {
namespace {

/// A sanitizer maps terabytes of address space, uses system calls of its own, and is slower.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
constexpr double kSlower = 20.0;
#else
constexpr bool kSanitized = false;
constexpr double kSlower = 1.0;
#endif

constexpr int kOut = 3;
constexpr int kPipe_bytes = 1 << 20;
/// Time between two looks at the processor time of the child.
constexpr int kLook_ms = 50;

[[noreturn]] void fail(const char* call) {
  throw std::system_error(errno, std::generic_category(), call);
}

// --- In the child: only system calls, and memory of its own ------------------------------------------------

/// The handlers of the parent release its device, which the child must not do.
void reset_signals() {
  for (int signal = 1; signal < NSIG; ++signal) ::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
}

/// Closes every descriptor but kOut. The standard streams become /dev/null: the library may print an error of
/// its heap.
void keep_only(int out) {
  if (out != kOut) ::dup2(out, kOut);
  const int null = ::open("/dev/null", O_RDWR);
  for (int fd = 0; fd < kOut; ++fd)
    if (null >= 0) ::dup2(null, fd);
  if (::syscall(SYS_close_range, kOut + 1, ~0U, 0) == 0) return;
  const long most = ::sysconf(_SC_OPEN_MAX);
  for (int fd = kOut + 1; fd < most; ++fd) ::close(fd);
}

void set_limit(int resource, std::uint64_t limit) {
  // A service manager may deny the call; the parent watches the time, too.
  const rlimit both{limit, limit};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

/// Size of the address space [bytes]; 0 if not known.
std::uint64_t address_space_bytes() {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// Permits the system calls of computing, memory and writing to open descriptors. Every other call fails with
/// EPERM.
void deny_system_calls() {
#if defined(__x86_64__) || defined(__aarch64__)
#if defined(__x86_64__)
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#else
  constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#endif
  constexpr std::array kPermitted = {
      SYS_read,           SYS_write,         SYS_close,        SYS_lseek,
      SYS_fstat,          SYS_mmap,          SYS_munmap,       SYS_mremap,
      SYS_mprotect,       SYS_madvise,       SYS_brk,          SYS_futex,
      SYS_exit,           SYS_exit_group,    SYS_rt_sigaction, SYS_rt_sigprocmask,
      SYS_rt_sigreturn,   SYS_clock_gettime, SYS_gettimeofday, SYS_getpid,
      SYS_gettid,         SYS_tgkill,        SYS_sched_yield,  SYS_getrandom,
      SYS_restart_syscall};
  std::vector<sock_filter> program = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
                                      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0),
                                      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
                                      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr))};
  for (const long call : kPermitted) {
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1));
    program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
  }
  program.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM));
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0)
    ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0);
#endif
}

void limit_this_process(const ChildLimits& limits) {
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_CPU, static_cast<std::uint64_t>(std::ceil(limits.cpu_s * kSlower)) + 1);
  set_limit(RLIMIT_FSIZE, 0);
  if (kSanitized) return;
  if (const std::uint64_t used = address_space_bytes(); used > 0 && limits.memory_bytes > 0)
    set_limit(RLIMIT_AS, used + limits.memory_bytes);
  set_limit(RLIMIT_NOFILE, kOut + 1);
  deny_system_calls();
}

void write_all(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::write(kOut, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) ::_exit(1);
    bytes.remove_prefix(static_cast<std::size_t>(put));
  }
}

[[noreturn]] void be_child(int out, pid_t parent, const ChildLimits& limits,
                           const std::function<void(const std::function<void(std::string_view)>&)>& work) {
  try {
    reset_signals();
    ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
    if (::getppid() != parent) ::_exit(1);
    keep_only(out);
    limit_this_process(limits);
    work(write_all);
  } catch (...) {  // the stream lacks its end
    ::_exit(1);
  }
  ::_exit(0);  // no exit handlers: libraries would write files of the parent
}

// --- In the parent -----------------------------------------------------------------------------------------

/// Ends the child and waits for it.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() { end(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  double cpu_s() const {
    clockid_t clock{};
    timespec used{};
    if (::clock_getcpuclockid(pid_, &clock) != 0 || ::clock_gettime(clock, &used) != 0) return 0.0;
    return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }
  void end() {
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
  }
  /// Returns the signal that ends the child, which has closed its pipe; 0: none, or not known. Ends a child
  /// that goes on without its pipe.
  int end_signal() {
    for (int looks = 0; looks < 100; ++looks) {
      int status = 0;
      const pid_t got = ::waitpid(pid_, &status, WNOHANG);
      if (got == 0) {
        ::poll(nullptr, 0, 10);
        continue;
      }
      if (got < 0 && errno == EINTR) continue;
      pid_ = -1;
      return got > 0 && WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    }
    end();
    return 0;
  }

 private:
  pid_t pid_;
};

}  // namespace

ChildEnd run_limited_child(
    const ChildLimits& limits,
    const std::function<void(const std::function<void(std::string_view)>& write)>& work,
    const std::function<bool(std::string_view)>& receive) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) fail("pipe");
  OwnedFd in(ends[0]), out(ends[1]);
  ::fcntl(in.get(), F_SETPIPE_SZ, kPipe_bytes);  // only faster
  const pid_t self = ::getpid();
  // No handler of the parent may run in the child, before the child has reset them.
  sigset_t all, before;
  sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  const pid_t pid = ::fork();
  if (pid == 0) be_child(out.get(), self, limits, work);
  const int fork_error = errno;
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  if (pid < 0) throw std::system_error(fork_error, std::generic_category(), "fork");
  Child child(pid);
  out.reset();
  std::vector<char> buffer(kPipe_bytes);
  auto last_byte = std::chrono::steady_clock::now();
  for (;;) {
    pollfd readable{in.get(), POLLIN, 0};
    const int ready = ::poll(&readable, 1, kLook_ms);
    const auto now = std::chrono::steady_clock::now();
    if (ready > 0) {
      const ssize_t got = ::read(in.get(), buffer.data(), buffer.size());
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return {false, child.end_signal()};
      last_byte = now;
      if (!receive({buffer.data(), static_cast<std::size_t>(got)})) return {false, 0};
    }
    const std::chrono::duration<double> silent = now - last_byte;
    if (child.cpu_s() > limits.cpu_s * kSlower || silent.count() > limits.wall_s * kSlower) {
      child.end();
      return {true, 0};
    }
  }
}

}  // namespace wrenchd
