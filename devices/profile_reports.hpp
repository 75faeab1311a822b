// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "devices/layout_check.hpp"

namespace wrenchd {

/// What a profile expects its device's report descriptor to say: all that it reads of the device, and what it
/// writes where it writes. As when it is matched, a device may lack what carries nothing of a pose, a
/// battery's state for one, and its reports may be as short as the profile allows. Checksums and constant
/// bytes are fields like any other. Not RT safe.
std::vector<ExpectedReport> expected_reports(const DeviceProfile& profile);

}  // namespace wrenchd
