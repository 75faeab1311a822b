// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/length.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace wrenchd {
namespace {

struct Unit {
  const char* name;
  double mm;
};

constexpr std::array kUnits = {Unit{"mm", 1.0},          Unit{"millimetre", 1.0}, Unit{"millimeter", 1.0},
                               Unit{"um", 1e-3},         Unit{"micron", 1e-3},    Unit{"micrometre", 1e-3},
                               Unit{"micrometer", 1e-3}, Unit{"cm", 10.0},        Unit{"centimetre", 10.0},
                               Unit{"centimeter", 10.0}, Unit{"m", 1000.0},       Unit{"metre", 1000.0},
                               Unit{"meter", 1000.0},    Unit{"in", 25.4},        Unit{"inch", 25.4},
                               Unit{"ft", 304.8},        Unit{"foot", 304.8},     Unit{"feet", 304.8}};

}  // namespace

std::optional<double> unit_length_mm(std::string_view unit) {
  std::string lower(unit);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Unit& known : kUnits)
    if (lower == known.name) return known.mm;
  return {};
}

const char* known_units() noexcept {
  return "um, mm, cm, m, in, ft";
}

double parse_length_mm(const std::string& text) {
  double x = 0.0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, x);
  if (error != std::errc{} || !std::isfinite(x))
    throw std::invalid_argument("'" + printable_name(text) + "' is no length; write it as 0.02mm");
  std::string unit(rest, end);
  unit.erase(0, unit.find_first_not_of(' '));
  if (unit.empty()) throw std::invalid_argument("'" + text + "' has no unit; did you mean " + text + "mm?");
  const auto unit_mm = unit_length_mm(unit);
  if (!unit_mm)
    throw std::invalid_argument("'" + printable_name(text) + "' has an unknown unit; use one of " +
                                known_units());
  return x * *unit_mm;
}

std::string short_number(double x) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", x);
  return text.data();
}

std::string place_text(double x_mm, double y_mm, double z_mm) {
  return "(" + short_number(x_mm) + ", " + short_number(y_mm) + ", " + short_number(z_mm) + ") mm";
}

std::string printable_name(std::string_view name) {
  constexpr std::size_t kMost = 80;
  std::string text(name.substr(0, kMost));
  for (char& c : text)
    if (const auto byte = static_cast<unsigned char>(c); byte < 0x20 || byte == 0x7f) c = '?';
  return name.size() > kMost ? text + "..." : text;
}

}  // namespace wrenchd
