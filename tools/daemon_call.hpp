// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>

#include <wrenchd/client.hpp>

#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Response timeout, above the duration of the slowest request (a mesh of a million triangles).
inline constexpr auto kResponseTimeout = std::chrono::seconds(60);

/// Calls a method of the daemon. Throws ClientError. Not RT-safe: waits for the daemon.
Json call(Client& client, const std::string& method, const Json& params = Json::object());

/// Writes text to standard output at once, so that a reader of a pipe receives it.
void print(const std::string& text);

/// Returns JSON for a user, with its line end.
std::string pretty(const Json& json);

}  // namespace wrenchd
