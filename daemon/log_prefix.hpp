// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// Begins the log lines of the calling thread with the name of a hand while this object lives: "left: ". An
/// empty name is the first hand, whose lines have no prefix. Not RT-safe: allocates.
class LogPrefix {
 public:
  explicit LogPrefix(const std::string& hand);
  ~LogPrefix();
  LogPrefix(const LogPrefix&) = delete;
  LogPrefix& operator=(const LogPrefix&) = delete;

  /// Prefix of the calling thread.
  static const std::string& current() noexcept;

 private:
  std::string previous_;
};

}  // namespace wrenchd
