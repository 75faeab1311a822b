// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>

#include <sys/types.h>

#include "daemon/control/owned_fd.hpp"

namespace wrenchd::test {

/// The kinds of abuse of a control socket.
inline constexpr std::array<const char*, 6> kAbuseNames = {"floods_requests", "never_reads", "floods_rubbish",
                                                           "endless_line",    "connects",    "asks_for_all"};

/// Abuses a control socket from a separate process.
class Abusers {
 public:
  /// The threads share the kinds of abuse. uid: the user of the abusers, if this process may change its user.
  /// Throws std::system_error.
  Abusers(const std::filesystem::path& socket, int threads, uid_t uid);
  ~Abusers();
  Abusers(const Abusers&) = delete;
  Abusers& operator=(const Abusers&) = delete;

  void begin() { send(kAll); }
  /// Begins one kind of abuse alone: its place in kAbuseNames.
  void begin(std::size_t kind) { send(static_cast<char>(kind)); }
  void end() { send(kNone); }

 private:
  static constexpr char kAll = 'a', kNone = 'n';

  void send(char what);
  [[noreturn]] void live(const std::filesystem::path& socket, int threads) const;

  std::array<int, 2> pipe_{};
  pid_t pid_ = -1;
};

/// An unrelated socket in a separate process, which accepts every connection and reads all input.
class Decoy {
 public:
  /// Throws std::system_error.
  explicit Decoy(const std::filesystem::path& socket);
  ~Decoy();
  Decoy(const Decoy&) = delete;
  Decoy& operator=(const Decoy&) = delete;

 private:
  [[noreturn]] void live() const;

  OwnedFd listens_;
  pid_t pid_ = -1;
};

}  // namespace wrenchd::test
