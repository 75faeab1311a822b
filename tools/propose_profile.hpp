// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "tools/descriptor_source.hpp"

namespace wrenchd {

/// Returns the text of a profile for a device whose report descriptor is known. Properties from the
/// descriptor are filled in, guesses are marked, and properties that only a person can know are left open.
/// The text is valid TOML, but loads only after its completion. Limits are never guessed. The proposal for a
/// multi-axis controller loads once the lines marked FILL IN are complete, and then agrees with its
/// descriptor.
///
/// Throws std::runtime_error if the descriptor is invalid, or if the device is neither a multi-axis
/// controller nor a device with vendor-defined reports. Not RT-safe: allocates.
///
/// fitting: names of profiles that already fit the device; if there are any, the text begins with them.
std::string propose_profile(const DescriptorSource& source, const std::vector<std::string>& fitting = {});

/// Returns the names of all profiles that fit a device: its report descriptor agrees with the profile, and so
/// do its ids if they are known. Not RT-safe: allocates.
std::vector<std::string> fitting_profiles(const DescriptorSource& source,
                                          const std::vector<DeviceProfile>& profiles);

}  // namespace wrenchd
