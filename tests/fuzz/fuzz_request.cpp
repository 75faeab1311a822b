// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: daemon/control/json_rpc.cpp daemon/control/control_methods.cpp config/nearest_key.cpp
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <variant>

#include "daemon/control/control_methods.hpp"
#include "daemon/control/json_rpc.hpp"
#include "tests/fuzz/feed.hpp"

// Reads any bytes as lines of the control socket, from clients of any role. A line is rejected with one line
// of JSON, or its request has the parameters that the method requires.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// A method with a parameter of each type.
MethodTable make_table() {
  MethodTable table;
  const auto keep = [](const Json& params, const Caller& caller) {
    require(caller.role >= Role::operator_, "the role is at least operator");
    require(params.is_object(), "parameters are an object");
    require(params.contains("name") && params["name"].is_string(),
            "required parameters exist and have their type");
    require(params["name"].get<std::string>().find('\0') == std::string::npos, "texts have no zero byte");
    for (const auto& [name, value] : params.items()) {
      if (name == "duration_s")
        require(value.is_number() && std::isfinite(value.get<double>()), "numbers are finite");
      if (name == "position_m") {
        require(value.is_array() && value.size() == 3, "a vector has three numbers");
        for (const Json& x : value) require(std::isfinite(x.get<double>()), "numbers of a vector are finite");
      }
      if (name == "count") static_cast<void>(value.get<std::int64_t>());
      if (name == "names")
        for (const Json& text : value) static_cast<void>(text.get<std::string>());
    }
    return MethodResult(params);
  };
  table.add(MethodRow{"scene.move",
                      Role::operator_,
                      {{"name", ParamType::text, true, "Name."},
                       {"position_m", ParamType::vector, false, "Position."},
                       {"duration_s", ParamType::number, false, "Duration."},
                       {"count", ParamType::integer, false, "Count."},
                       {"names", ParamType::texts, false, "Other names."},
                       {"at_once", ParamType::boolean, false, "Immediately."},
                       {"more", ParamType::object, false, "Other values."}},
                      "Moves.",
                      keep});
  table.add(MethodRow{"stop", Role::observer, {}, "Stops.", [](const Json& params, const Caller&) {
                        require(params.empty(), "stop has no parameters");
                        return MethodResult(Json::object());
                      }});
  return table;
}

/// Requires that a reply is one line of JSON-RPC.
void check_line(const std::string& line) {
  require(!line.empty() && line.find('\n') == line.size() - 1, "a reply is one line");
  const Json reply = Json::parse(line, nullptr, false);
  require(reply.is_object() && reply["jsonrpc"] == "2.0" && reply.contains("id"),
          "a reply is JSON-RPC 2.0 with an id");
  require(reply.contains("result") != reply.contains("error"), "a reply has either a result or an error");
  if (!reply.contains("error")) return;
  require(reply["error"]["code"].is_number_integer(), "an error has a code");
  const auto sentence = reply["error"]["message"].get<std::string>();
  require(sentence.size() > 10 && (sentence.back() == '.' || sentence.back() == '?'),
          "an error has a sentence");
}

void serve(const MethodTable& table, std::string_view line, Role role) {
  const auto parsed = parse_request(line);
  if (const auto* invalid = std::get_if<InvalidRequest>(&parsed))
    return check_line(error_line(invalid->id, invalid->error));
  const auto& request = std::get<RpcRequest>(parsed);
  require(line.size() <= kMaxLineBytes, "longer lines are rejected");
  require(request.params.is_object(), "parameters are an object");
  require(request.wants_reply == !request.id.is_null(), "a request has an id exactly if it wants a reply");
  try {
    const MethodRow& row = table.look_up(request, role);
    require(role >= row.min_role, "the role is sufficient");
    check_line(reply_line(request.id, MethodTable::run(row, request.params, {1, role, "", nullptr}).result));
  } catch (const RpcError& error) {
    check_line(error_line(request.id, error));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MethodTable table = make_table();
  if (size == 0) return 0;
  const auto role = static_cast<Role>(data[0] % 3);
  std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  while (true) {
    const auto end = text.find('\n');
    serve(table, text.substr(0, end), role);
    if (end == std::string_view::npos) return 0;
    text.remove_prefix(end + 1);
  }
}
