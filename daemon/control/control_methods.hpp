// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "daemon/control/event_feed.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/control/owned_fd.hpp"
#include "daemon/control/role.hpp"

namespace wrenchd {

// What can be asked of the daemon: one row of one table for each method, in which `describe`, the checks and
// the socket look everything up. A part of the daemon adds its rows from a file of its own.

/// What a parameter may be. No number is ever NaN or infinite: JSON has none.
enum class ParamType : std::uint8_t { boolean, integer, number, text, texts, vector, object };

/// "three numbers"
const char* type_text(ParamType type) noexcept;

struct ParamRow {
  std::string name;  ///< ends in its unit
  ParamType type;
  bool required;
  std::string doc;
};

/// What a client hears of events. Belongs to its connection.
struct Subscription {
  bool active = false;
  std::set<std::string> event_names;  ///< none: all
  std::uint64_t next_sequence = 0;    ///< sequence number of the first that it has not got
  bool has_backlog = false;           ///< there are events already that it has not got
};

/// Who asks.
struct Caller {
  std::uint64_t client = 0;  ///< number of the connection, never used again
  Role role = Role::observer;
  std::string identity;                  ///< for people: "process 4242 of uid 1000"
  Subscription* subscription = nullptr;  ///< null in slow methods
};

/// What a method answers.
struct MethodResult {
  Json result;
  int fd = -1;  ///< goes with the reply (SCM_RIGHTS); -1: none
  std::shared_ptr<const OwnedFd> owned_fd;

  MethodResult(Json json) : result(std::move(json)) {}  // NOLINT: a result is an answer
  /// A descriptor that stays open here.
  MethodResult(Json json, int descriptor) : result(std::move(json)), fd(descriptor) {}
  /// One that is for whoever asked alone.
  MethodResult(Json json, OwnedFd descriptor)
      : result(std::move(json)),
        fd(descriptor.get()),
        owned_fd(std::make_shared<const OwnedFd>(std::move(descriptor))) {}
};

struct MethodRow {
  std::string name;  ///< "scene.move", or a plain verb
  Role min_role;     ///< the lowest role that may ask
  std::vector<ParamRow> params;
  std::string doc;  ///< what it does and answers, in a sentence or two
  /// params: all that are required are there, of their types, and no other than those of the row. Throws
  /// RpcError; a ConfigError becomes RpcCode::refused. Runs on the control thread, where it must not wait, or
  /// where `slow` is set on a thread for such.
  std::function<MethodResult(const Json& params, const Caller& caller)> run;
  bool slow = false;
};

/// All that can be asked. Built before the socket opens, and constant from then on.
class MethodTable {
 public:
  /// settings: for messages that say which group has a role.
  explicit MethodTable(ControlSettings settings = {}) : settings_(std::move(settings)) {}

  void add(MethodRow row);
  void add(EventRow row);

  const std::map<std::string, MethodRow>& methods() const noexcept { return methods_; }
  const std::vector<EventRow>& events() const noexcept { return events_; }

  /// The row for the request, when it is one that this role may make, with the parameters it has to have.
  /// Throws RpcError.
  const MethodRow& look_up(const RpcRequest& request, Role role) const;

  /// Runs it. Throws RpcError, and nothing else.
  static MethodResult run(const MethodRow& row, const Json& params, const Caller& caller);

  /// {version, protocol, roles, methods, events, errors, limits}
  Json describe() const;

 private:
  ControlSettings settings_;
  std::map<std::string, MethodRow> methods_;
  std::vector<EventRow> events_;
};

}  // namespace wrenchd
