// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <functional>
#include <optional>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/prove/abused_daemon.hpp"

namespace wrenchd::test {

/// A user who has no role, and is not the one who abuses the daemon.
inline constexpr uid_t kOtherUser = 65533;

/// A process of another user. It sends numbers back.
class OtherUser {
 public:
  using Report = std::function<void(long)>;
  OtherUser(uid_t user, const std::function<void(const Report&)>& work) {
    if (::pipe2(pipe_.data(), O_CLOEXEC) != 0)
      throw std::system_error(errno, std::generic_category(), "pipe");
    pid_ = ::fork();
    if (pid_ == 0) {
      ::close(pipe_[0]);
      if (become(user)) try {
          work([this](long number) {
            [[maybe_unused]] const auto n = ::write(pipe_[1], &number, sizeof number);
          });
        } catch (const std::exception&) {
        }
      ::_exit(0);
    }
    ::close(pipe_[1]);
  }
  ~OtherUser() {
    ::close(pipe_[0]);
    if (pid_ > 0) ::kill(pid_, SIGKILL), ::waitpid(pid_, nullptr, 0);
  }
  OtherUser(const OtherUser&) = delete;
  OtherUser& operator=(const OtherUser&) = delete;

  /// Returns the next number; nothing if the process has ended, or sends none within this time; -1: waits.
  std::optional<long> next(std::chrono::milliseconds limit = std::chrono::milliseconds(-1)) {
    pollfd readable{pipe_[0], POLLIN, 0};
    long number = 0;
    if (::poll(&readable, 1, static_cast<int>(limit.count())) > 0 &&
        ::read(pipe_[0], &number, sizeof number) == sizeof number)
      return number;
    return {};
  }
  bool has_ended() const {
    siginfo_t info{};
    ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT | WNOHANG);
    return info.si_pid == pid_;
  }

 private:
  std::array<int, 2> pipe_{};
  pid_t pid_ = -1;
};

}  // namespace wrenchd::test
