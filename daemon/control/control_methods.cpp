// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_methods.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "config/config_error.hpp"
#include "config/nearest_key.hpp"
#include "config/setting_table.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
namespace {

/// Version of the protocol. Increase it with each change that breaks a client of the previous version.
constexpr int kProtocol = 2;

/// Returns what a reload does with a changed setting.
const char* on_reload_text(Setting::Effect effect) noexcept {
  switch (effect) {
    case Setting::Effect::new_rendering:
      return "crossfades to a new rendering";
    case Setting::Effect::immediate:
      return "applies at once";
    case Setting::Effect::limits:
      return "applies at once if tighter; if looser, only while the loop is disarmed";
    case Setting::Effect::restart:
      return "requires a restart";
    case Setting::Effect::scene:
      return "loads the scene if its files have changed";
    case Setting::Effect::none:
      return "has no effect";
  }
  return "";
}

Json settings_description() {
  Json settings = Json::array();
  for (const Setting& setting : setting_table())
    if (setting.read != nullptr)
      settings.push_back({{"name", setting.name()}, {"on_reload", on_reload_text(setting.effect)}});
  return settings;
}

bool is_vector(const Json& value) {
  return value.is_array() && value.size() == 3 &&
         std::all_of(value.begin(), value.end(), [](const Json& x) { return x.is_number(); });
}

/// Returns true if the value is an integer that fits into int64.
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

/// Returns the text with a full stop at its end.
std::string sentence(const std::string& text) {
  return text.ends_with('?') || text.ends_with('.') ? text : text + '.';
}

std::string dumped(const Json& value) {
  return printable(value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

RpcError invalid_params(const MethodRow& row, const std::string& error) {
  return {RpcCode::invalid_params, sentence("Method '" + row.name + "': " + error)};
}

void check_params(const MethodRow& row, const Json& params) {
  std::vector<KnownKey> known;
  for (const ParamRow& param : row.params) known.push_back({param.name, std::string(unit_of(param.name))});
  for (const auto& [name, value] : params.items()) {
    const auto param = std::find_if(row.params.begin(), row.params.end(),
                                    [&name = name](const ParamRow& p) { return p.name == name; });
    if (param == row.params.end())
      throw invalid_params(row, known.empty() ? "it takes no parameters, found '" + printable(name) + "'"
                                              : "there is no parameter '" + printable(name) + "'; " +
                                                    nearest_key(name, known).advice);
    if (!is(value, param->type))
      throw invalid_params(row, "parameter '" + name + "' must be " + type_text(param->type) + ", found " +
                                    dumped(value) + "; it is: " + param->doc);
  }
  for (const ParamRow& param : row.params)
    if (param.required && !params.contains(param.name))
      throw invalid_params(row, "parameter '" + param.name + "', " + type_text(param.type) +
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
  // The role comes first: a client without permission gets no advice about parameters.
  if (role < row.min_role)
    throw RpcError(RpcCode::permission_denied,
                   "Method '" + row.name + "' is for " + name(row.min_role) + "s, and you are " +
                       (role == Role::observer ? "an " : "a ") + name(role) + ". It is for " +
                       role_group_text(row.min_role, settings_) + ".",
                   {{"role", name(role)}, {"min_role", name(row.min_role)}});
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
        {{"name", name}, {"min_role", wrenchd::name(row.min_role)}, {"params", params}, {"doc", row.doc}});
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
          {"settings", settings_description()},
          {"errors",
           {error(RpcCode::parse_error, "The line is not valid JSON."),
            error(RpcCode::invalid_request, "The line is valid JSON, but no request."),
            error(RpcCode::method_not_found, "There is no such method."),
            error(RpcCode::invalid_params, "A parameter is unknown, missing, or of the wrong type."),
            error(RpcCode::internal_error, "The method failed because of an error in the daemon."),
            error(RpcCode::permission_denied, "The role is too low. data: role, min_role."),
            error(RpcCode::invalid_state, "The present state does not allow the request. data: state."),
            error(RpcCode::lease_held, "Another client holds the lease. data: holder."),
            error(RpcCode::rejected, "A file or value that the request names is invalid.")}},
          {"limits",
           {{"line_bytes", kMaxLineBytes}, {"depth", kMaxDepth}, {"events_kept", EventFeed::kHistorySize}}}};
}

}  // namespace wrenchd
