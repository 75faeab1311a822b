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

Settings load_settings(const fs::path& file, const SearchPath& search, std::optional<SecondHand>* second) {
  std::string text = read_config_text(file);
  Settings settings = load_settings(read_toml_text(text, file), file, search, second);
  if (second != nullptr && *second) (*second)->settings.text = text;
  settings.text = std::move(text);
  return settings;
}

Settings load_settings(const TomlNode& tree, const fs::path& file, const SearchPath& search,
                       std::optional<SecondHand>* second) {
  Settings settings;
  settings.file = file;
  std::optional<SecondHand> other;
  const auto read = [&](TomlTable& root) {
    const SettingContext context{search, file};
    root.foreign({"mass", "tool", "obstacle", "body", "gravity_m_per_s2", "surface_tolerance_m"},
                 "this is a scene: give it with --scene, or as 'scene' in a configuration");
    read_settings(root, context, settings);
    other = read_second_hand(root, context, settings);
  };
  read_toml_node(file, tree, read);
  for (Settings* hand : {&settings, other ? &other->settings : nullptr})
    if (hand != nullptr)
      hand->hand_script_text = load_hand_script(hand->simulation.hand_script, hand->simulation);
  if (second != nullptr) *second = std::move(other);
  return settings;
}

}  // namespace wrenchd
