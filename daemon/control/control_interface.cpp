// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_interface.hpp"

#include "daemon/control/daemon_methods.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

Control::Control(Station& station, EventFeed& feed)
    : station_(station),
      feed_(feed),
      lease_(station.loop(), feed),
      methods_(station.plan().settings.control) {
  add_daemon_methods(methods_, {station_, feed_, lease_, status_});
}

void Control::open(const std::filesystem::path& path, const Identify& identify) {
  const Settings& settings = station_.plan().settings;
  const RoleRules rules = role_rules(settings.control, settings.file.string());
  listening_.emplace(path, rules);
  socket_.emplace(*listening_, rules, methods_, feed_, lease_, identify);
}

}  // namespace wrenchd
