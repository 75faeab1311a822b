// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "config/toml_file.hpp"
#include "daemon/control/setting_keys.hpp"

namespace wrenchd {
namespace {

/// "wrench.stiffness" for each key of a file; what a key's own table says belongs to it.
void collect(const TomlNode& node, const std::string& before, std::set<std::string>& names) {
  for (const TomlEntry& entry : std::get<TomlNode::Table>(node.value)) {
    const std::string name = before + entry.key;
    const auto* table = std::get_if<TomlNode::Table>(&entry.node.value);
    const bool section = table != nullptr && (before.empty() || name == "rendering.friction");
    if (section)
      collect(entry.node, name + ".", names);
    else
      names.insert(name);
  }
}

TEST_CASE("a reload knows every key of wrenchd.toml", "[reload]") {
  std::set<std::string> documented, known;
  collect(read_toml_file(WRENCHD_SOURCE_DIR "/config/wrenchd.toml"), "", documented);
  for (const SettingKey& key : setting_keys()) known.insert(key.name);
  documented.erase("scene");        // whose files are looked at
  documented.erase("description");  // for people
  known.erase("simulation.hand_script (what it says)");
  known.erase("simulation.playback (what it says)");
  CHECK(documented.size() > 40);
  for (const std::string& name : documented) {
    INFO(name);
    CHECK(known.count(name) == 1);
  }
  CHECK(known == documented);
}

TEST_CASE("a key that is copied is the same afterwards", "[reload]") {
  Settings changed;
  changed.device.tool_in_handle.position_m = {1, 2, 3};
  changed.wrench.gains.stiffness(0, 0) = 17.0;
  changed.limits.soft_start_s = 3.0;
  changed.recording.file = "run.h5";
  changed.simulation.hand_path = {{0.0, {1, 1, 1}, Vector3d::Zero()}};
  int differ = 0;
  Settings copy;
  for (const SettingKey& key : setting_keys()) {
    if (key.same(copy, changed)) continue;
    ++differ;
    key.copy(changed, copy);
    CHECK(key.same(copy, changed));
  }
  CHECK(differ == 5);
}

}  // namespace
}  // namespace wrenchd
