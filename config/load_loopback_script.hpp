// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "config/config_error.hpp"
#include "core/simulated_fault.hpp"

namespace wrenchd {

/// Reads the faults and requests of a loopback run; format: devices/README.md, "Faults on request". Throws
/// ConfigError. Not RT-safe: reads a file.
LoopbackScript load_loopback_script(const std::filesystem::path& file);

}  // namespace wrenchd
