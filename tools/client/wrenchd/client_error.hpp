// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace wrenchd {

/// Why something could not be done, in a sentence that says what to do.
class ClientError : public std::runtime_error {
 public:
  /// Beside the daemon's own codes, which are below zero (JSON-RPC 2.0).
  enum Code : int {
    kNoDaemon = 1,  ///< nobody answers at the socket
    kGone = 2,      ///< the connection ended
    kTimeout = 3,   ///< no answer in time
    kProtocol = 4,  ///< what came is not what this library understands
    kNotAllowed = -32001,
    kNotNow = -32002,
    kTaken = -32003,
    kRefusedInput = -32004,
  };

  ClientError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  int code() const noexcept { return code_; }

 private:
  int code_;
};

}  // namespace wrenchd
