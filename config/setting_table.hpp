// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/search_path.hpp"
#include "config/settings.hpp"
#include "config/toml_reader.hpp"

namespace wrenchd {

/// The file that is read, and where the files that it names are searched.
struct SettingContext {
  const SearchPath& search;
  const std::filesystem::path& file;
};

/// One setting of wrenchd.toml. The table of all settings is the only list of them: loading, reload and the
/// annotated example config/wrenchd.toml use it or are tested against it.
struct Setting {
  /// What a change of the setting requires while the loop runs.
  enum class Effect : std::uint8_t {
    new_rendering,  ///< a new rendering; wrenchd crossfades to it
    immediate,      ///< nothing: clients read the value
    limits,         ///< tighter limits apply at once; looser limits require a disarmed loop
    restart,        ///< a restart of wrenchd
    scene,          ///< a new scene; a reload compares the scene files instead of the setting
    none,           ///< a reload ignores the setting
  };

  std::string_view section;  ///< "wrench", "rendering.friction"; empty: top of the file
  std::string_view key;      ///< "stiffness"
  std::string_view unit;     ///< unit for messages, if the key does not end in it
  Effect effect;
  /// Reads the value, present or absent; returns true if it is present and valid. nullptr: the setting has no
  /// key of its own, it is the content of the file that the key names.
  bool (*read)(const TomlValue& value, const SettingContext& context, Settings& settings);
  bool (*equal)(const Settings& a, const Settings& b);
  void (*copy)(const Settings& from, Settings& to);
  double (*number)(const Settings& settings);  ///< value of a setting that is one number, otherwise nullptr

  /// "wrench.stiffness"; "simulation.playback (content)" without a key of its own.
  std::string name() const;
};

/// All settings, in the order in which a reload applies and reports them.
std::span<const Setting> setting_table() noexcept;

/// Reads all sections of a root table, and rejects unknown keys and combinations of values that exclude each
/// other.
void read_settings(TomlTable& root, const SettingContext& context, Settings& settings);

/// The names of the sections that each hand has for itself. Not RT-safe: allocates.
std::vector<std::string_view> sections_of_hand();

/// Reads the sections_of_hand() over the values that `settings` has. Rejects the sections that apply to both
/// hands. hand: a [[hand]] table.
void read_hand_settings(TomlTable& hand, const SettingContext& context, Settings& settings);

/// Reads [rendering] and [wrench] only.
void read_rendering_settings(TomlTable& root, const SettingContext& context, Settings& settings);

}  // namespace wrenchd
