// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// Returns the examples of the paper, section 4, computed with wrenchd's methods, beside the numbers that the
/// paper prints. Not RT-safe: allocates.
std::string paper_tables();

}  // namespace wrenchd
