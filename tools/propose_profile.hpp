// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/descriptor_source.hpp"

namespace wrenchd {

/// The text of a profile for a device of which only the report descriptor is known: what it says is written
/// down, what was guessed from it is marked, and what only a person can know is left open, so that the text
/// is good TOML and does not load before somebody has completed it. Limits are never guessed. A multi-axis
/// controller's loads once the lines marked FILL IN are filled in, and agrees with its descriptor.
///
/// Throws std::runtime_error where the descriptor is refused, or where the device is neither a multi-axis
/// controller nor one with reports of its maker's own.
std::string propose_profile(const DescriptorSource& source);

}  // namespace wrenchd
