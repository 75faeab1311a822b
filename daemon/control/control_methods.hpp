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
#include "daemon/control/role.hpp"
#include "files/owned_fd.hpp"

namespace wrenchd {

// The method table: one row for each method of the control socket. `describe`, the parameter checks and the
// socket read this table. Each part of the daemon adds its rows from a file of its own. Not RT-safe:
// allocates.

/// Type of a parameter. A number is always finite, because JSON has neither NaN nor infinity.
enum class ParamType : std::uint8_t { boolean, integer, number, text, texts, vector, object };

/// Returns the type in words: "an array of three numbers".
const char* type_text(ParamType type) noexcept;

struct ParamRow {
  std::string name;  ///< ends in the unit of the parameter
  ParamType type;
  bool required;
  std::string doc;
};

/// Event subscription of a client. Belongs to its connection.
struct Subscription {
  bool active = false;
  std::set<std::string> event_names;  ///< empty: all events
  std::uint64_t next_sequence = 0;    ///< sequence number of the first event that is not sent yet
  bool has_backlog = false;           ///< true: the feed holds events that did not fit into the last batch
};

/// The client that calls a method.
struct Caller {
  std::uint64_t client = 0;  ///< number of the connection; each number is used once
  Role role = Role::observer;
  std::string identity;                  ///< for people: "process 4242 of uid 1000"
  Subscription* subscription = nullptr;  ///< null in slow methods
};

/// Result of a method.
struct MethodResult {
  Json result;
  int fd = -1;  ///< sent with the reply (SCM_RIGHTS); -1: none
  std::shared_ptr<const OwnedFd> owned_fd;

  MethodResult(Json json) : result(std::move(json)) {}  // NOLINT: implicit, so that a method returns JSON
  /// The caller keeps the descriptor open.
  MethodResult(Json json, int descriptor) : result(std::move(json)), fd(descriptor) {}
  /// The result owns the descriptor and closes it.
  MethodResult(Json json, OwnedFd descriptor)
      : result(std::move(json)),
        fd(descriptor.get()),
        owned_fd(std::make_shared<const OwnedFd>(std::move(descriptor))) {}
};

struct MethodRow {
  std::string name;  ///< "scene.move", or a plain verb
  Role min_role;     ///< lowest role that may call the method
  std::vector<ParamRow> params;
  std::string doc;  ///< effect and result, in one or two sentences
  /// params: have the types of the row, include every required parameter and no unknown one. Throws RpcError;
  /// a ConfigError becomes RpcCode::rejected. Must not block unless `slow` is set.
  std::function<MethodResult(const Json& params, const Caller& caller)> run;
  bool slow = false;  ///< true: runs on the worker thread; false: runs on the control thread
};

/// All methods and events. Complete before the socket opens, and constant afterwards.
class MethodTable {
 public:
  /// settings: name the group of each role in error messages.
  explicit MethodTable(ControlSettings settings = {}) : settings_(std::move(settings)) {}

  void add(MethodRow row);
  void add(EventRow row);

  const std::map<std::string, MethodRow>& methods() const noexcept { return methods_; }
  const std::vector<EventRow>& events() const noexcept { return events_; }

  /// Returns the row of the requested method. Throws RpcError if the method is unknown, the role is too low
  /// or a parameter is wrong.
  const MethodRow& look_up(const RpcRequest& request, Role role) const;

  /// Runs the method. Turns every exception into RpcError.
  static MethodResult run(const MethodRow& row, const Json& params, const Caller& caller);

  /// {version, protocol, roles, methods, events, settings, errors, limits}. settings: one entry for each key
  /// of wrenchd.toml in setting_table().
  Json describe() const;

 private:
  ControlSettings settings_;
  std::map<std::string, MethodRow> methods_;
  std::vector<EventRow> events_;
};

}  // namespace wrenchd
