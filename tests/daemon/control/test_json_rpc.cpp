// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/json_rpc.hpp"
#include "tests/support/request_line.hpp"

namespace wrenchd::test_json_rpc {

namespace {

RpcRequest request_of(const std::string& line) {
  auto read = parse_request(line);
  if (const auto* rejected = std::get_if<InvalidRequest>(&read)) FAIL(line << ": " << rejected->error.what());
  return std::get<RpcRequest>(std::move(read));
}

std::string nested(std::size_t depth) {
  return R"({"jsonrpc":"2.0","method":"stop","params":{"a":)" + std::string(depth, '[') +
         std::string(depth, ']') + "}}";
}

TEST_CASE("a line is one request: method, named parameters, and an id if it expects a response",
          "[json_rpc]") {
  const RpcRequest full =
      request_of(R"( {"jsonrpc":"2.0","id":7,"method":"scene.move","params":{"name":"a"}} )");
  CHECK(full.method == "scene.move");
  CHECK(full.params == Json{{"name", "a"}});
  CHECK(full.id == 7);
  CHECK(full.wants_reply);

  const RpcRequest notification = request_of("{\"method\":\"lease.heartbeat\",\"jsonrpc\":\"2.0\"}\r");
  CHECK_FALSE(notification.wants_reply);
  CHECK(notification.params == Json::object());

  for (const char* id : {"\"text\"", "0", "-3", "9007199254740992", "\"\""})
    CHECK(request_of(std::string(R"({"jsonrpc":"2.0","method":"stop","id":)") + id + "}").id ==
          Json::parse(id));
  CHECK(request_of(nested(kMaxDepth - 2)).method == "stop");
}

TEST_CASE("a line that is not a valid request is rejected with the reason, and with its id if known",
          "[json_rpc]") {
  const std::string head = R"({"jsonrpc":"2.0","id":5,"method":"stop")";
  struct {
    std::string line;
    RpcCode code;
    std::string reason;
    bool has_id = false;
  } const table[] = {
      {"", RpcCode::parse_error, "it is empty; send one object a line"},
      {" \t\r", RpcCode::parse_error, "it is empty"},
      {"{", RpcCode::parse_error, "it is not JSON"},
      {head, RpcCode::parse_error, "it is not JSON"},
      {head + "}}", RpcCode::parse_error, "at byte 41"},
      {head + "} {}", RpcCode::parse_error, "it is not JSON"},
      {"{'jsonrpc':'2.0'}", RpcCode::parse_error, "at byte 2"},
      {head + ",}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":NaN}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":1e999}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":01}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":\"\xff\xfe\"}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":\"\xc0\x80\"}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":\"\\ud800\"}}", RpcCode::parse_error, "it is not JSON"},
      {head + ",\"params\":{\"a\":\"\t\"}}", RpcCode::parse_error, "it is not JSON"},
      {head + std::string("}\0", 2), RpcCode::parse_error, "it contains a zero byte"},
      {head + ",\"params\":{\"a\":\"x\\u0000y\"}}", RpcCode::parse_error, "contains the character zero"},
      {head + ",\"params\":{\"a\\u0000\":1}}", RpcCode::parse_error, "contains the character zero"},
      {head + ",\"id\":6}", RpcCode::parse_error, "the name 'id' occurs twice in one object"},
      {head + ",\"params\":{\"a\":[{\"b\":1,\"b\":2}]}}", RpcCode::parse_error, "the name 'b' occurs twice"},
      {nested(kMaxDepth - 1), RpcCode::parse_error, "deeper than 16"},
      {nested(30000), RpcCode::parse_error, "deeper than 16"},
      {head + ",\"params\":{\"a\":\"" + std::string(kMaxLineBytes, 'x') + "\"}}", RpcCode::parse_error,
       "longer than 65536 bytes"},
      {"[" + head + "}]", RpcCode::invalid_request, "Batches are not supported"},
      {"[]", RpcCode::invalid_request, "Batches are not supported"},
      {"1", RpcCode::invalid_request, "A request is an object"},
      {"\"stop\"", RpcCode::invalid_request, "A request is an object"},
      {"null", RpcCode::invalid_request, "A request is an object"},
      {"{}", RpcCode::invalid_request, "does not name JSON-RPC 2.0"},
      {R"({"jsonrpc":"1.0","id":5,"method":"stop"})", RpcCode::invalid_request, "does not name JSON-RPC 2.0",
       true},
      {R"({"jsonrpc":2.0,"id":5,"method":"stop"})", RpcCode::invalid_request, "does not name JSON-RPC 2.0",
       true},
      {R"({"jsonrpc":"2.0","id":5})", RpcCode::invalid_request, "names no method", true},
      {R"({"jsonrpc":"2.0","id":5,"method":5})", RpcCode::invalid_request, "names no method", true},
      {head + ",\"parms\":{}}", RpcCode::invalid_request, "no member 'parms'; did you mean 'params'?", true},
      {head + ",\"params\":[1]}", RpcCode::invalid_params, "Parameters have names", true},
      {head + ",\"params\":null}", RpcCode::invalid_params, "Parameters have names", true},
      {R"({"jsonrpc":"2.0","id":1.5,"method":"stop"})", RpcCode::invalid_request, "The id must be"},
      {R"({"jsonrpc":"2.0","id":null,"method":"stop"})", RpcCode::invalid_request, "The id must be"},
      {R"({"jsonrpc":"2.0","id":{},"method":"stop"})", RpcCode::invalid_request, "The id must be"},
      {R"({"jsonrpc":"2.0","id":true,"method":"stop"})", RpcCode::invalid_request, "The id must be"},
      {R"({"jsonrpc":"2.0","id":9007199254740993,"method":"stop"})", RpcCode::invalid_request,
       "The id must be"},
      {R"({"jsonrpc":"2.0","id":-9007199254740993,"method":"stop"})", RpcCode::invalid_request,
       "The id must be"},
      {R"({"jsonrpc":"2.0","id":99999999999999999999,"method":"stop"})", RpcCode::invalid_request,
       "The id must be"},
      {R"({"jsonrpc":"2.0","method":"stop","id":")" + std::string(kMaxIdBytes + 1, 'i') + "\"}",
       RpcCode::invalid_request, "The id must be"},
  };
  for (const auto& [line, code, reason, has_id] : table) {
    INFO(line.substr(0, 200));
    const auto read = parse_request(line);
    const auto* rejected = std::get_if<InvalidRequest>(&read);
    REQUIRE(rejected);
    CHECK(rejected->error.code() == code);
    INFO(rejected->error.what());
    CHECK(std::string(rejected->error.what()).find(reason) != std::string::npos);
    CHECK(rejected->id == (has_id ? Json(5) : Json(nullptr)));
  }
}

TEST_CASE("each response is one line of JSON-RPC, with any content", "[json_rpc]") {
  CHECK(reply_line(3, {{"state", "disarmed"}}) ==
        "{\"jsonrpc\":\"2.0\",\"id\":3,\"result\":{\"state\":\"disarmed\"}}\n");
  CHECK(error_line(nullptr, RpcError(RpcCode::lease_held, "Two\nlines.")) ==
        "{\"jsonrpc\":\"2.0\",\"id\":null,\"error\":{\"code\":-32003,\"message\":\"Two\\nlines.\"}}\n");
  CHECK(error_line("a", RpcError(RpcCode::invalid_state, "No.", {{"state", "fault"}}))
            .find("\"data\":{\"state\"") != std::string::npos);
  const std::string broken = notification_line("event", {{"text", "\xff\n"}});
  CHECK(Json::parse(broken)["params"]["text"] == "\xef\xbf\xbd\n");
  CHECK(std::count(broken.begin(), broken.end(), '\n') == 1);
  const RpcRequest back = request_of([] {
    std::string line = test::request_line(1, "lease.heartbeat", Json::object());
    line.pop_back();
    return line;
  }());
  CHECK(back.method == "lease.heartbeat");
}

}  // namespace
}  // namespace wrenchd::test_json_rpc
