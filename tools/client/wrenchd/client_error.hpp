// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace wrenchd {

/// The reason for a failure, as a message that says what to do.
class ClientError : public std::runtime_error {
 public:
  /// The library's own codes are positive; the daemon's codes are negative (JSON-RPC 2.0).
  enum Code : int {
    kNoDaemon = 1,      ///< no daemon accepts connections at the socket
    kDisconnected = 2,  ///< the connection has ended
    kTimeout = 3,       ///< no response in time
    kProtocol = 4,      ///< the received data has an unknown format
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
