// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_methods.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "config/config_error.hpp"
#include "config/nearest_key.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
namespace {

/// Of the protocol: one more when a client that knows the last would misread us.
constexpr int kProtocol = 1;

bool is_vector(const Json& value) {
  return value.is_array() && value.size() == 3 &&
         std::all_of(value.begin(), value.end(), [](const Json& x) { return x.is_number(); });
}

/// 2.0 is whole too; what an int64 does not hold is not.
bool is_whole(const Json& value) {
  if (value.is_number_unsigned())
    return value.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  return value.is_number_integer();
}

bool is(const Json& value, ParamType type) {
  switch (type) {
    case ParamType::boolean:
      return value.is_boolean();
    case ParamType::integer:
      return is_whole(value);
    case ParamType::number:
      return value.is_number();
    case ParamType::text:
      return value.is_string();
    case ParamType::texts:
      return value.is_array() &&
             std::all_of(value.begin(), value.end(), [](const Json& x) { return x.is_string(); });
    case ParamType::vector:
      return is_vector(value);
    case ParamType::object:
      return value.is_object();
  }
  return false;
}

/// With the point that it may lack.
std::string sentence(const std::string& words) {
  return words.ends_with('?') || words.ends_with('.') ? words : words + '.';
}

std::string found(const Json& value) {
  return printable(value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

RpcError wrong_params(const MethodRow& row, const std::string& what) {
  return {RpcCode::invalid_params, sentence("Method '" + row.name + "': " + what)};
}

void check_params(const MethodRow& row, const Json& params) {
  std::vector<KnownKey> known;
  for (const ParamRow& param : row.params) known.push_back({param.name, std::string(unit_of(param.name))});
  for (const auto& [name, value] : params.items()) {
    const auto param = std::find_if(row.params.begin(), row.params.end(),
                                    [&name = name](const ParamRow& p) { return p.name == name; });
    if (param == row.params.end())
      throw wrong_params(row, known.empty() ? "it takes no parameters, and not '" + printable(name) + "'"
                                            : "there is no parameter '" + printable(name) + "'; " +
                                                  nearest_key(name, known).advice);
    if (!is(value, param->type))
      throw wrong_params(row, "parameter '" + name + "' has to be " + type_text(param->type) + ", and is " +
                                  found(value) + "; it is: " + param->doc);
  }
  for (const ParamRow& param : row.params)
    if (param.required && !params.contains(param.name))
      throw wrong_params(row, "parameter '" + param.name + "', " + type_text(param.type) +
                                  ", is missing; it is: " + param.doc);
}

}  // namespace

const char* type_text(ParamType type) noexcept {
  switch (type) {
    case ParamType::boolean:
      return "true or false";
    case ParamType::integer:
      return "a whole number";
    case ParamType::number:
      return "a number";
    case ParamType::text:
      return "a text";
    case ParamType::texts:
      return "an array of texts";
    case ParamType::vector:
      return "an array of three numbers";
    case ParamType::object:
      return "an object";
  }
  return "unknown";
}

void MethodTable::add(MethodRow row) {
  std::string name = row.name;
  if (!methods_.emplace(name, std::move(row)).second)
    throw std::logic_error("method '" + name + "' is added twice");
}

void MethodTable::add(EventRow row) {
  for (const EventRow& known : events_)
    if (known.name == row.name) throw std::logic_error("event '" + row.name + "' is added twice");
  events_.push_back(std::move(row));
}

const MethodRow& MethodTable::look_up(const RpcRequest& request, Role role) const {
  const auto found = methods_.find(request.method);
  if (found == methods_.end()) {
    std::vector<KnownKey> known;
    for (const auto& [name, row] : methods_) known.push_back({name, ""});
    throw RpcError(RpcCode::method_not_found, sentence("There is no method '" + printable(request.method) +
                                                       "'; " + nearest_key(request.method, known).advice));
  }
  const MethodRow& row = found->second;
  // Who may not ask learns nothing of whether it asked well.
  if (role < row.min_role)
    throw RpcError(RpcCode::permission_denied,
                   "Method '" + row.name + "' is for " + name(row.min_role) + "s, and you are " +
                       (role == Role::observer ? "an " : "a ") + name(role) + ". It is for " +
                       role_group_text(row.min_role, settings_) + ".",
                   {{"role", name(role)}, {"needs", name(row.min_role)}});
  check_params(row, request.params);
  return row;
}

MethodResult MethodTable::run(const MethodRow& row, const Json& params, const Caller& caller) {
  try {
    return row.run(params, caller);
  } catch (const RpcError&) {
    throw;
  } catch (const ConfigError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  } catch (const std::exception& error) {
    throw RpcError(RpcCode::internal_error, "Method '" + row.name + "' failed: " + error.what() + ".");
  }
}

Json MethodTable::describe() const {
  Json methods = Json::array();
  for (const auto& [name, row] : methods_) {
    Json params = Json::object();
    for (const ParamRow& param : row.params)
      params[param.name] = {
          {"type", type_text(param.type)}, {"required", param.required}, {"doc", param.doc}};
    methods.push_back(
        {{"name", name}, {"role", wrenchd::name(row.min_role)}, {"params", params}, {"doc", row.doc}});
  }
  Json events = Json::array();
  for (const EventRow& row : events_) events.push_back({{"name", row.name}, {"doc", row.doc}});
  Json roles = Json::object();
  for (const Role role : {Role::observer, Role::operator_, Role::administrator})
    roles[name(role)] = role_group_text(role, settings_);
  const auto error = [](RpcCode code, const char* doc) {
    return Json{{"code", static_cast<int>(code)}, {"doc", doc}};
  };
  return {{"version", kVersion},
          {"protocol", kProtocol},
          {"roles", roles},
          {"methods", methods},
          {"events", events},
          {"errors",
           {error(RpcCode::parse_error, "The line was not understood."),
            error(RpcCode::invalid_request, "It is JSON, and no request."),
            error(RpcCode::method_not_found, "There is no such method."),
            error(RpcCode::invalid_params, "A parameter is unknown, missing, or of another type."),
            error(RpcCode::internal_error, "It failed, and that is the daemon's fault."),
            error(RpcCode::permission_denied, "The role is too low. data: role, needs."),
            error(RpcCode::invalid_state, "The state does not allow it. data: state."),
            error(RpcCode::lease_held, "Somebody else holds the lease. data: holder."),
            error(RpcCode::rejected, "What the request names is not as it has to be.")}},
          {"limits",
           {{"line_bytes", kMaxLineBytes}, {"depth", kMaxDepth}, {"events_kept", EventFeed::kHistorySize}}}};
}

}  // namespace wrenchd
