// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include <spdlog/fmt/fmt.h>

#include "core/spatial.hpp"
#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Returns a parameter of three numbers; `otherwise` if the request has no such parameter. Precondition: the
/// method table has checked the type (ParamType::vector). Not RT-safe.
inline Vector3d vector_of(const Json& params, const char* name, const Vector3d& otherwise) {
  const auto found = params.find(name);
  if (found == params.end()) return otherwise;
  return {(*found)[0].get<double>(), (*found)[1].get<double>(), (*found)[2].get<double>()};
}

/// Throws RpcError if the vector of a parameter is longer than `limit`. cure: what to do, for the message.
/// Not RT-safe.
inline void check_length(const char* parameter, const Vector3d& v, double limit, const char* unit,
                         const std::string& cure) {
  if (v.norm() <= limit) return;
  throw RpcError(RpcCode::invalid_params,
                 fmt::format("'{}' has a length of {:.4g} {}; {}.", parameter, v.norm(), unit, cure));
}

}  // namespace wrenchd
