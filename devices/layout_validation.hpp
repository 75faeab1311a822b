// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"

namespace wrenchd {

/// Validates a layout. Throws std::invalid_argument with the fields and the byte if fields overlap, exceed
/// the report, are meaningless or leave no room for the checksum. Not RT-safe: allocates.
void validate(const PoseReportLayout& layout);
void validate(const WrenchReportLayout& layout);
/// Validates all reports of a profile. Throws std::invalid_argument also if the reports together give no
/// pose, cannot be distinguished, or if the wrench report cannot represent the limits. Not RT-safe:
/// allocates.
void validate_reports(const DeviceProfile& profile);

}  // namespace wrenchd
