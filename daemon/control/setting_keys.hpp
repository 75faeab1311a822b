// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "config/settings.hpp"

namespace wrenchd {

/// One key of wrenchd.toml, and what can become of it while the loop runs.
struct SettingKey {
  enum class Effect : std::uint8_t {
    new_rendering,  ///< another rendering, which takes the place of the last without a jump
    immediate,      ///< nothing: it is for whoever asks
    limits,         ///< where it is tighter, nothing; where it is looser, a loop that is disarmed
    restart,        ///< what it is for is built once
  };

  const char* name;  ///< "wrench.stiffness"
  Effect effect;
  bool (*same)(const Settings& a, const Settings& b);
  void (*copy)(const Settings& from, Settings& to);
};

/// All keys but `scene`, in the order of the file.
std::span<const SettingKey> setting_keys() noexcept;

}  // namespace wrenchd
