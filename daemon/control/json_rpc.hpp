// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json.hpp>

namespace wrenchd {

// JSON-RPC 2.0 as wrenchd uses it: one object a line, in UTF-8, ended by '\n'. Parameters have names; batches
// are not supported. This file parses and formats lines and does no I/O. Not RT-safe: allocates.

/// JSON whose members keep their order.
using Json = nlohmann::ordered_json;

inline constexpr std::size_t kMaxLineBytes = std::size_t{64} * 1024;  ///< without the '\n'
inline constexpr std::size_t kMaxDepth = 16;                          ///< nesting of objects and arrays
inline constexpr std::size_t kMaxIdBytes = 128;                       ///< length of an id that is a text

/// Error codes of JSON-RPC 2.0, and those of wrenchd (-32001 and below).
enum class RpcCode : int {
  parse_error = -32700,
  invalid_request = -32600,
  method_not_found = -32601,
  invalid_params = -32602,
  internal_error = -32603,
  permission_denied = -32001,  ///< the role is too low
  invalid_state = -32002,      ///< the present state does not allow the request
  lease_held = -32003,         ///< another client holds the lease
  rejected = -32004,           ///< a file or value that the request names is invalid
};

/// Error of a request. what() is a sentence that says what to do.
class RpcError : public std::runtime_error {
 public:
  /// details: an object for programs, sent as `data` of the error; null: none.
  RpcError(RpcCode code, const std::string& sentence, Json details = nullptr)
      : std::runtime_error(sentence), code_(code), details_(std::move(details)) {}
  RpcCode code() const noexcept { return code_; }
  const Json& details() const noexcept { return details_; }

 private:
  RpcCode code_;
  Json details_;
};

struct RpcRequest {
  std::string method;
  Json params = Json::object();  ///< always an object
  Json id;                       ///< text or integer
  bool wants_reply = false;      ///< true: the request has an id; false: no reply, not even an error
};

/// A line that is not a valid request.
struct InvalidRequest {
  Json id;  ///< id of the request if the line has a readable one; else null
  RpcError error;
};

/// Parses a line without its '\n'. Returns InvalidRequest, and does not throw, for invalid JSON or UTF-8,
/// zero bytes, repeated names, nesting above kMaxDepth, length above kMaxLineBytes, another JSON-RPC version,
/// a batch and unknown members.
std::variant<RpcRequest, InvalidRequest> parse_request(std::string_view line);

/// Return a line with its '\n'. Invalid UTF-8 in a text is replaced.
std::string reply_line(const Json& id, const Json& result);
std::string error_line(const Json& id, const RpcError& error);
std::string notification_line(const std::string& method, const Json& params);

}  // namespace wrenchd
