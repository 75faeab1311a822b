// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_settings.hpp"
#include "config/setting_table.hpp"
#include "config/toml_file.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_setting_table {

namespace {

namespace fs = std::filesystem;

const fs::path kConfig = test::source_path("config");
const SearchPath kShipped({kConfig});

bool is_section(std::string_view name) {
  for (const Setting& setting : setting_table())
    if (setting.section == name) return true;
  return false;
}

/// Returns "wrench.stiffness" for each key of a file. A table that is not a section of the setting table is a
/// value.
void collect(const TomlNode& node, const std::string& before, std::set<std::string>& names) {
  for (const TomlEntry& entry : std::get<TomlNode::Table>(node.value)) {
    const std::string name = before + entry.key;
    if (is_section(name))
      collect(entry.node, name + ".", names);
    else
      names.insert(name);
  }
}

std::set<std::string> documented() {
  std::set<std::string> names;
  collect(read_toml_file(kConfig / "wrenchd.toml"), "", names);
  return names;
}

}  // namespace

TEST_CASE("each setting has its paragraph in wrenchd.toml, and each key there is a setting", "[settings]") {
  std::set<std::string> known;
  for (const Setting& setting : setting_table())
    if (setting.read != nullptr) known.insert(setting.name());
  const std::set<std::string> keys = documented();
  CHECK(keys.size() > 40);
  for (const std::string& name : keys) {
    INFO(name);
    CHECK(known.count(name) == 1);
  }
  for (const std::string& name : known) {
    INFO(name);
    CHECK(keys.count(name) == 1);
  }
}

TEST_CASE("a setting has one row in the table", "[settings]") {
  std::set<std::string> names;
  for (const Setting& setting : setting_table()) {
    INFO(setting.name());
    CHECK(names.insert(setting.name()).second);
  }
}

TEST_CASE("each number of the configuration reaches its member", "[settings]") {
  const Settings defaults = load_settings(kConfig / "wrenchd.toml", kShipped);
  int changed_numbers = 0;
  for (const Setting& setting : setting_table()) {
    if (setting.number == nullptr || setting.section == "rendering.friction") continue;
    INFO(setting.name());
    // A nearby value in the range; integers stay integers.
    const double old = setting.number(defaults);
    bool reached = false;
    for (const double value : {old + 1.0, old - 1.0, 1.01 * old, 0.99 * old, 0.5, 0.0005}) {
      if (value == old) continue;
      const std::string text = "[" + std::string(setting.section) + "]\n" + std::string(setting.key) + " = " +
                               to_text(value) + "\n";
      Settings changed;
      try {
        changed =
            load_settings(read_toml_text(text, kConfig / "wrenchd.toml"), kConfig / "wrenchd.toml", kShipped);
      } catch (const ConfigError&) {
        continue;
      }
      reached = true;
      CHECK(setting.number(changed) == value);
      CHECK_FALSE(setting.equal(changed, defaults));
      break;
    }
    CHECK(reached);
    ++changed_numbers;
  }
  CHECK(changed_numbers > 30);
}

TEST_CASE("a setting that is copied is equal afterwards", "[settings]") {
  Settings changed;
  changed.device.tool_in_handle.position_m = {1, 2, 3};
  changed.wrench.gains.stiffness(0, 0) = 17.0;
  changed.limits.soft_start_s = 3.0;
  changed.recording.file = "run.h5";
  changed.simulation.hand_path = {{0.0, {1, 1, 1}, Vector3d::Zero()}};
  int different = 0;
  Settings copy;
  for (const Setting& setting : setting_table()) {
    if (setting.equal(copy, changed)) continue;
    ++different;
    setting.copy(changed, copy);
    CHECK(setting.equal(copy, changed));
  }
  CHECK(different == 5);
}

TEST_CASE("a limit is a number, so a reload can report the value that still applies", "[settings]") {
  for (const Setting& setting : setting_table())
    if (setting.effect == Setting::Effect::limits) CHECK(setting.number != nullptr);
}

}  // namespace wrenchd::test_setting_table
