// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "core/simulated_fault.hpp"

namespace wrenchd {

/// Reads what shall go wrong with a simulated device and when, and what is asked of the loop meanwhile;
/// devices/README.md, "Faults on request", is the format's page. Throws ConfigError.
LoopbackScript load_loopback_script(const std::filesystem::path& file);

}  // namespace wrenchd
