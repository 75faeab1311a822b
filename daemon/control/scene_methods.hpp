// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "daemon/control/control_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/reconfigurator.hpp"

namespace wrenchd {

/// The rows of what is rendered: scene, rendering, workspace, local models, reload. Both must outlive the
/// table. reload_all: what `reload` does; it throws as Workbench::reload().
void add_scene_methods(MethodTable& table, Reconfigurator& workbench,
                       std::function<ReloadResult()> reload_all);

/// Reads the configuration again, and tells what became of it. Throws as Workbench::reload(), when that is
/// told.
ReloadResult reload_config(Reconfigurator& workbench, EventFeed& feed,
                           const std::function<RunConfig()>& read);

/// What a client gave in JSON as a table of a configuration file, to be read and refused in the same words.
/// Throws RpcError where it holds a null, which no such file knows.
TomlNode toml_of(const Json& json);

}  // namespace wrenchd
