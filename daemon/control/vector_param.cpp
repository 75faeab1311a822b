// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/vector_param.hpp"

#include <spdlog/fmt/fmt.h>

namespace wrenchd {

Vector3d vector_of(const Json& params, const char* name, const Vector3d& otherwise) {
  const auto found = params.find(name);
  if (found == params.end()) return otherwise;
  return {(*found)[0].get<double>(), (*found)[1].get<double>(), (*found)[2].get<double>()};
}

void check_length(const char* parameter, const Vector3d& v, double limit, const char* unit,
                  const std::string& cure) {
  if (v.norm() <= limit) return;
  throw RpcError(RpcCode::invalid_params,
                 fmt::format("'{}' has a length of {:.4g} {}; {}.", parameter, v.norm(), unit, cure));
}

}  // namespace wrenchd
