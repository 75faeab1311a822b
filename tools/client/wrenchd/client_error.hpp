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
    kNoDaemon = 1,      ///< nobody answers at the socket
    kDisconnected = 2,  ///< the connection ended
    kTimeout = 3,       ///< no answer in time
    kProtocol = 4,      ///< what came is not what this library understands
    kPermissionDenied = -32001,
    kInvalidState = -32002,
    kLeaseHeld = -32003,
    kRejected = -32004,
  };

  ClientError(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  int code() const noexcept { return code_; }

 private:
  int code_;
};

}  // namespace wrenchd
