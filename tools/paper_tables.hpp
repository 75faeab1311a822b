// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd {

/// The examples of section 4 of the paper, run by wrenchd's methods, beside the numbers the paper prints.
std::string paper_tables();

}  // namespace wrenchd
