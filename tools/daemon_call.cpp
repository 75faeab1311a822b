// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/daemon_call.hpp"

#include <cstdio>

namespace wrenchd {

Json call(Client& client, const std::string& method, const Json& params) {
  return Json::parse(client.call(method, params.dump()));
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

std::string pretty(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace wrenchd
