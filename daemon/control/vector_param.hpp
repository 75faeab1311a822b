// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/spatial.hpp"
#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Returns a parameter of three numbers; `otherwise` if the request has no such parameter. Precondition: the
/// method table has checked the type (ParamType::vector). Not RT-safe.
Vector3d vector_of(const Json& params, const char* name, const Vector3d& otherwise);

/// Throws RpcError if the vector of a parameter is longer than `limit`. cure: what to do, for the message.
/// Not RT-safe.
void check_length(const char* parameter, const Vector3d& v, double limit, const char* unit,
                  const std::string& cure);

}  // namespace wrenchd
