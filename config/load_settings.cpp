// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_settings.hpp"

#include <utility>

#include "config/load_hand_script.hpp"
#include "config/setting_table.hpp"
#include "config/toml_reader.hpp"

namespace wrenchd {

namespace fs = std::filesystem;

void change_rendering(const TomlNode& changes, const fs::path& source, Settings& settings) {
  Settings changed = settings;
  // Neither [rendering] nor [wrench] names a file, so nothing is searched.
  const SearchPath no_search{std::vector<fs::path>{}};
  read_toml_node(source, changes, read_rendering_settings, SettingContext{no_search, source}, changed);
  settings = std::move(changed);
}

Settings load_settings(const fs::path& file, const SearchPath& search) {
  std::string text = read_config_text(file);
  Settings settings = load_settings(read_toml_text(text, file), file, search);
  settings.text = std::move(text);
  return settings;
}

Settings load_settings(const TomlNode& tree, const fs::path& file, const SearchPath& search) {
  Settings settings;
  settings.file = file;
  read_toml_node(file, tree, read_settings, SettingContext{search, file}, settings);
  settings.hand_script_text = load_hand_script(settings.simulation.hand_script, settings.simulation);
  return settings;
}

}  // namespace wrenchd
