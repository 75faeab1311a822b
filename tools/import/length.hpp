// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace wrenchd {

/// Returns the length of a unit in millimetres; nothing if the unit is unknown. Accepts symbols and names:
/// "mm", "millimetre", "inch", "in", ... Ignores upper and lower case. Not RT-safe: allocates.
std::optional<double> unit_length_mm(std::string_view unit);

/// Returns the units that unit_length_mm() accepts as symbols: "um, mm, cm, m, in, ft". RT-safe.
const char* known_units() noexcept;

/// Returns the millimetres of a text such as "0.02mm" or "0.001 in". Throws std::invalid_argument, the reason
/// with its remedy, if there is no number, no unit or an unknown unit. Not RT-safe: allocates.
double parse_length_mm(const std::string& text);

/// Returns a length or another number with four significant digits, for reports. Not RT-safe: allocates.
std::string short_number(double x);

/// Returns a position in millimetres for reports: "(1, 2.5, 3) mm". Not RT-safe: allocates.
std::string place_text(double x_mm, double y_mm, double z_mm);

/// Returns a name from a file for messages: without control characters, of at most 80 bytes. Not RT-safe:
/// allocates.
std::string printable_name(std::string_view name);

}  // namespace wrenchd
