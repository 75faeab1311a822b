// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "daemon/control/control_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/reconfigurator.hpp"

namespace wrenchd {

/// Adds the methods for scene, rendering, workspace, local models and reload. The reconfigurator must outlive
/// the table. reload_all: implements `reload`, and throws as Reconfigurator::reload(). Not RT-safe:
/// allocates.
void add_scene_methods(MethodTable& table, Reconfigurator& reconfigurator,
                       std::function<ReloadResult()> reload_all);

/// Reads the configuration again, applies it, and emits the event `reload`. Throws as
/// Reconfigurator::reload(), after the event. Not RT-safe: reads files, may take seconds.
ReloadResult reload_config(Reconfigurator& reconfigurator, EventFeed& feed,
                           const std::function<RunConfig()>& read);

/// Returns JSON as a table of a configuration file, so that both have the same checks and messages. Throws
/// RpcError for a null, which TOML does not have. Not RT-safe: allocates.
TomlNode toml_of(const Json& json);

}  // namespace wrenchd
