// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "daemon/control/json_rpc.hpp"

namespace wrenchd::test {

/// Returns the line of a JSON-RPC request that has an id.
inline std::string request_line(const Json& id, const std::string& method, const Json& params) {
  const Json request = {{"jsonrpc", "2.0"}, {"id", id}, {"method", method}, {"params", params}};
  return request.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace wrenchd::test
