// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/json_rpc.hpp"

#include <cstdint>
#include <set>
#include <vector>

#include "config/config_error.hpp"
#include "config/nearest_key.hpp"

namespace wrenchd {
namespace {

/// JSON integers are exact up to this value in every language.
constexpr std::int64_t kLargestId = std::int64_t{1} << 53;

/// SAX handler that stops at the first error of a line: errors that the parser accepts, and input that costs
/// the parser too much.
class LineCheck final : public nlohmann::json_sax<Json> {
 public:
  const std::string& wrong() const noexcept { return wrong_; }

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t& text) override {
    if (text.find('\0') == string_t::npos) return true;
    return reject("a text contains the character zero");
  }
  bool binary(binary_t&) override { return reject("it is binary"); }
  bool start_object(std::size_t) override { return enter(); }
  bool start_array(std::size_t) override { return enter(); }
  bool end_object() override { return leave(); }
  bool end_array() override { return leave(); }
  bool key(string_t& name) override {
    if (!string(name)) return false;
    if (names_.back().insert(name).second) return true;
    return reject("the name '" + printable(name) + "' occurs twice in one object; remove one");
  }
  bool parse_error(std::size_t position, const std::string& token, const Json::exception&) override {
    return reject("at byte " + std::to_string(position) + ", after '" + printable(token) +
                  "', it is not JSON");
  }

 private:
  bool reject(std::string what) {
    wrong_ = std::move(what);
    return false;
  }
  bool enter() {
    names_.emplace_back();
    return names_.size() <= kMaxDepth ||
           reject("objects and arrays are nested deeper than " + std::to_string(kMaxDepth));
  }
  bool leave() {
    names_.pop_back();
    return true;
  }

  std::vector<std::set<std::string>> names_;
  std::string wrong_;
};

/// Returns the error of a line as text, as a part of a sentence; empty: no error.
std::string wrong_with(std::string_view line) {
  if (line.size() > kMaxLineBytes)
    return "it is longer than " + std::to_string(kMaxLineBytes) + " bytes; send shorter lines";
  if (line.find('\0') != std::string_view::npos) return "it contains a zero byte";
  if (line.find_first_not_of(" \t\r") == std::string_view::npos) return "it is empty; send one object a line";
  LineCheck check;
  Json::sax_parse(line, &check);
  return check.wrong();
}

bool is_id(const Json& id) {
  if (id.is_string()) return id.get_ref<const std::string&>().size() <= kMaxIdBytes;
  if (id.is_number_unsigned()) return id.get<std::uint64_t>() <= static_cast<std::uint64_t>(kLargestId);
  return id.is_number_integer() && id.get<std::int64_t>() >= -kLargestId;
}

/// What is wrong with the object, as a sentence; empty: nothing.
std::string wrong_with(const Json& object) {
  const std::vector<KnownKey> known = {{"jsonrpc", ""}, {"id", ""}, {"method", ""}, {"params", ""}};
  for (const auto& [name, value] : object.items()) {
    bool is_known = false;
    for (const KnownKey& key : known) is_known = is_known || key.name == name;
    if (!is_known)
      return "A request has no member '" + printable(name) + "'; " + nearest_key(name, known).advice;
  }
  if (const auto version = object.find("jsonrpc"); version == object.end() || *version != "2.0")
    return "The request does not name JSON-RPC 2.0; add \"jsonrpc\":\"2.0\"";
  if (const auto method = object.find("method"); method == object.end() || !method->is_string())
    return "The request names no method; method \"describe\" lists all methods";
  if (const auto id = object.find("id"); id != object.end() && !is_id(*id))
    return "The id must be a text of at most " + std::to_string(kMaxIdBytes) +
           " bytes or an integer of at most 2^53";
  return {};
}

std::string line_of(const Json& object) {
  return object.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace

std::variant<RpcRequest, InvalidRequest> parse_request(std::string_view line) {
  if (const std::string wrong = wrong_with(line); !wrong.empty())
    return InvalidRequest{nullptr,
                          RpcError(RpcCode::parse_error, "The line was not understood: " + wrong + ".")};
  Json object = Json::parse(line, nullptr, false);
  if (object.is_array())
    return InvalidRequest{nullptr, RpcError(RpcCode::invalid_request,
                                            "Batches are not supported; send each request on its own line.")};
  if (!object.is_object())
    return InvalidRequest{nullptr, RpcError(RpcCode::invalid_request,
                                            "A request is an object, as in "
                                            "{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"describe\"}.")};
  RpcRequest request;
  const auto id = object.find("id");
  request.wants_reply = id != object.end();
  if (request.wants_reply && is_id(*id)) request.id = *id;
  if (const std::string wrong = wrong_with(object); !wrong.empty())
    return InvalidRequest{request.id,
                          RpcError(RpcCode::invalid_request, wrong.ends_with('?') ? wrong : wrong + ".")};
  request.method = object["method"].get<std::string>();
  const auto params = object.find("params");
  if (params == object.end()) return request;
  if (!params->is_object())
    return InvalidRequest{request.id, RpcError(RpcCode::invalid_params,
                                               "Parameters have names: params is an object, or left out.")};
  request.params = std::move(*params);
  return request;
}

std::string reply_line(const Json& id, const Json& result) {
  return line_of({{"jsonrpc", "2.0"}, {"id", id}, {"result", result}});
}

std::string error_line(const Json& id, const RpcError& error) {
  Json body = {{"code", static_cast<int>(error.code())}, {"message", error.what()}};
  if (!error.details().is_null()) body["data"] = error.details();
  return line_of({{"jsonrpc", "2.0"}, {"id", id}, {"error", body}});
}

std::string notification_line(const std::string& method, const Json& params) {
  return line_of({{"jsonrpc", "2.0"}, {"method", method}, {"params", params}});
}

}  // namespace wrenchd
