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

// Any bytes as lines of the control socket, from somebody of any role: refused with a reply that is one line
// of JSON, or a request that the method it names may rely on.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// A method with a parameter of each type.
MethodTable make_table() {
  MethodTable table;
  const auto keep = [](const Json& params, const Caller& caller) {
    hold(caller.role >= Role::operator_, "nobody below an operator runs it");
    hold(params.is_object(), "parameters are an object");
    hold(params.contains("name") && params["name"].is_string(), "what is required is there, of its type");
    hold(params["name"].get<std::string>().find('\0') == std::string::npos, "no text holds a zero");
    for (const auto& [name, value] : params.items()) {
      if (name == "duration_s")
        hold(value.is_number() && std::isfinite(value.get<double>()), "numbers are finite");
      if (name == "position_m") {
        hold(value.is_array() && value.size() == 3, "a vector has three");
        for (const Json& x : value) hold(std::isfinite(x.get<double>()), "finite ones");
      }
      if (name == "count") static_cast<void>(value.get<std::int64_t>());
      if (name == "names")
        for (const Json& text : value) static_cast<void>(text.get<std::string>());
    }
    return Answer(params);
  };
  table.add(MethodRow{"scene.move",
                      Role::operator_,
                      {{"name", ParamType::text, true, "which"},
                       {"position_m", ParamType::vector, false, "where"},
                       {"duration_s", ParamType::number, false, "how fast"},
                       {"count", ParamType::integer, false, "how often"},
                       {"names", ParamType::texts, false, "others"},
                       {"at_once", ParamType::boolean, false, "at once"},
                       {"more", ParamType::object, false, "more"}},
                      "Moves.",
                      keep});
  table.add(MethodRow{"stop", Role::observer, {}, "Stops.", [](const Json& params, const Caller&) {
                        hold(params.empty(), "it takes no parameters");
                        return Answer(Json::object());
                      }});
  return table;
}

/// What goes out is one line of JSON-RPC.
void check_line(const std::string& line) {
  hold(!line.empty() && line.find('\n') == line.size() - 1, "one line");
  const Json told = Json::parse(line, nullptr, false);
  hold(told.is_object() && told["jsonrpc"] == "2.0" && told.contains("id"), "of JSON-RPC");
  hold(told.contains("result") != told.contains("error"), "with a result or an error");
  if (!told.contains("error")) return;
  hold(told["error"]["code"].is_number_integer(), "an error has a code");
  const auto sentence = told["error"]["message"].get<std::string>();
  hold(sentence.size() > 10 && (sentence.back() == '.' || sentence.back() == '?'), "and a sentence");
}

void serve(const MethodTable& table, std::string_view line, Role role) {
  const auto read = read_request(line);
  if (const auto* refused = std::get_if<RefusedLine>(&read))
    return check_line(error_line(refused->id, refused->error));
  const auto& request = std::get<RpcRequest>(read);
  hold(line.size() <= kMaxLineBytes, "no line is longer than allowed");
  hold(request.params.is_object(), "parameters are an object");
  hold(request.wants_reply == !request.id.is_null(), "who wants a reply has an id");
  try {
    const MethodRow& row = table.look_up(request, role);
    hold(role >= row.least, "the role is enough");
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
