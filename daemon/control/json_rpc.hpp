// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json.hpp>

namespace wrenchd {

// JSON-RPC 2.0 as wrenchd speaks it: one object a line, in UTF-8, ended by '\n'. Parameters have names, and
// there are no batches. Here is what a line means, and nothing of where it comes from. Not RT safe.

/// Members keep their order, so that what is printed reads as it was written.
using Json = nlohmann::ordered_json;

inline constexpr std::size_t kMaxLineBytes = std::size_t{64} * 1024;  ///< without the '\n'
inline constexpr std::size_t kMaxDepth = 16;                          ///< of objects and arrays in each other
inline constexpr std::size_t kMaxIdBytes = 128;                       ///< of an id that is text

/// The numbers of JSON-RPC 2.0, and ours.
enum class RpcCode : int {
  parse_error = -32700,
  invalid_request = -32600,
  method_not_found = -32601,
  invalid_params = -32602,
  internal_error = -32603,
  permission_denied = -32001,  ///< the role is too low
  invalid_state = -32002,      ///< the state does not allow it
  lease_held = -32003,         ///< somebody else holds the lease
  rejected = -32004,           ///< what it names, a file or a place in a scene, is not as it has to be
};

/// Why a request is not done: what() is a whole sentence that says what to do.
class RpcError : public std::runtime_error {
 public:
  /// details: an object for programs, `data` of the reply; null: none.
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
  Json id;                       ///< text or a whole number
  bool wants_reply = false;      ///< it has an id; else nothing is answered, not even an error
};

/// A line that is no request.
struct InvalidRequest {
  Json id;  ///< the line's, where that much can be told; else null
  RpcError error;
};

/// What a line without its '\n' says. Never throws for what stands in it: no JSON, bytes that are no UTF-8,
/// zero bytes, the same name twice, too deep, too long, another version, a batch, unknown members.
std::variant<RpcRequest, InvalidRequest> parse_request(std::string_view line);

/// Lines to send, with their '\n'. Bytes of a text that are no UTF-8 are replaced.
std::string reply_line(const Json& id, const Json& result);
std::string error_line(const Json& id, const RpcError& error);
std::string notification_line(const std::string& method, const Json& params);

/// The line of a request that wants a reply, for clients.
std::string request_line(const Json& id, const std::string& method, const Json& params);

}  // namespace wrenchd
