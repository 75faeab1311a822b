// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/import/imported_body.hpp"

namespace wrenchd {

/// The chord error of a mesh in a file, including the rounding of its format [mm].
struct StatedError {
  double mm = 0.0;
  double rounding_mm = 0.0;  ///< part of mm
};

/// Returns the line that an output file contains: format, unit, chord error, source. Not RT-safe: allocates.
std::string statement_text(const ImportedBody& body, const StatedError& error, const std::string& source);

/// Returns the lines of the report about a body: size, chord error, and the properties of the exact solid and
/// of the mesh with their difference. Not RT-safe: allocates.
std::string report_text(const ImportedBody& body, const StatedError& error);

/// Returns a number rounded up to three significant digits: an upper bound in a text. Not RT-safe: allocates.
std::string rounded_up(double x);

}  // namespace wrenchd
