// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_interface.hpp"

#include "daemon/control/daemon_methods.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

ControlInterface::ControlInterface(Runtime& runtime, EventFeed& feed)
    : runtime_(runtime),
      feed_(feed),
      lease_(runtime.loop(), feed),
      methods_(runtime.config().settings.control) {
  add_daemon_methods(methods_, {runtime_, feed_, lease_, status_sections_});
}

void ControlInterface::open(const std::filesystem::path& path, const IdentifyPeer& identify) {
  const Settings& settings = runtime_.config().settings;
  const RoleRules rules = load_role_rules(settings.control, settings.file.string());
  listening_socket_.emplace(path, rules, !runtime_.config().is_second);
  control_socket_.emplace(*listening_socket_, rules, methods_, feed_, lease_, identify);
}

}  // namespace wrenchd
